"""Write the dictionary of effects anew: `python docs/make_effects.py` from the repository's root.

A row an effect, from its record, below the heading `## The dictionary` of docs/effects.md.
"""

from __future__ import annotations

import re
from pathlib import Path

from syncline_design.effects import registry
from syncline_design.effects.record import Effect, Parameter

PAGE = Path(__file__).resolve().parent / "effects.md"
HEADING = "## The dictionary\n"
HEAD = "| effect | acts on | parameters | what it says | told apart by |\n|---|---|---|---|---|\n"


def parameter_text(one: Parameter) -> str:
    """`latency_s` [s], or its words where it has no unit."""
    return f"`{one.name}` [{one.unit}]" if one.unit else f"`{one.name}`"


def row(one: Effect) -> str:
    """An effect's row; its sentence with the parameters' names in their places."""
    says = re.sub(r"\{(\w+)[^}]*\}", lambda found: f"*{found[1]}*", one.sentence)
    parameters = ", ".join(parameter_text(p) for p in one.parameters)
    cells = (f"`{one.name}`", ", ".join(one.sensors), parameters, says, one.separated_by)
    return "| " + " | ".join(cells) + " |"


def dictionary() -> str:
    """The table."""
    return HEAD + "".join(f"{row(registry()[name])}\n" for name in sorted(registry()))


def main() -> None:
    before, heading, after = PAGE.read_text("utf-8").partition(HEADING)
    section, following, rest = after.partition("\n## ")
    intro = section.partition("\n| ")[0].rstrip("\n")
    PAGE.write_text(f"{before}{heading}{intro}\n\n{dictionary()}{following}{rest}", "utf-8")


if __name__ == "__main__":
    main()

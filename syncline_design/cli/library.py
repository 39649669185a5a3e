"""Commands to look and to start: catalog, schema, init."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from syncline_design.cli.shared import guarded, refuse, show
from syncline_design.report.formats import FileName, ResultName


@guarded
def catalog_list(
    section: Annotated[
        str | None,
        typer.Argument(help="platforms, sensors, timestamping, infrastructure or clocks."),
    ] = None,
) -> int:
    """List what the built-in catalogs hold."""
    from syncline_design.report.catalogs import SECTIONS, list_text
    from syncline_design.spec.load import load_builtin

    if section is not None and section not in SECTIONS:
        refuse(f"syncline-design: catalog list {section}: expected one of {', '.join(SECTIONS)}")
    show(list_text(load_builtin(), section))
    return 0


@guarded
def catalog_show(identity: Annotated[str, typer.Argument(metavar="ID")]) -> int:
    """Show one catalog entry with its figures, sources and assumptions."""
    from syncline_design.report.catalogs import show_text, suggestion
    from syncline_design.spec.load import load_builtin

    catalog = load_builtin()
    text = show_text(catalog, identity)
    if text is None:
        refuse(
            f"syncline-design: catalog show {identity}: no such entry"
            f"{suggestion(catalog, identity)}"
        )
    show(text)
    return 0


@guarded
def schema(
    name: Annotated[
        Literal[FileName, ResultName],
        typer.Argument(help="A kind of file (spec, catalog, study) or of result (the others)."),
    ],
) -> int:
    """Print the JSON Schema of a kind of file, for editors, or of a kind of result."""
    from syncline_design.report.result_schemas import result_schema_text
    from syncline_design.report.schema import schema_text

    match name:
        case "spec" | "catalog" | "study":
            show(schema_text(name))
        case _:
            show(result_schema_text(name))
    return 0


@guarded
def init(
    directory: Annotated[Path, typer.Argument(help="Folder for the starter files.")],
) -> int:
    """Write a commented starter spec, a study over it and their schemas into a folder."""
    from syncline_design.report.scaffold import init_project
    from syncline_design.report.text import visible

    show("".join(f"{visible(path)}\n" for path in init_project(directory)))
    return 0

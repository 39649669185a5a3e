"""Commands to look and to start: catalog, schema, init."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from syncline_design.cli.completions import (
    MEDIA,
    among,
    catalog_ids,
    catalog_sections,
    one_of,
    stub_types,
)
from syncline_design.cli.shared import (
    QuietOption,
    emit,
    guarded,
    output_option,
    output_targets,
    refuse,
    show,
)
from syncline_design.machine.streams import say
from syncline_design.model.roles import ROLES
from syncline_design.report.formats import CATALOG_FORMATS, FileName, ResultName

if TYPE_CHECKING:
    from syncline_design.report.catalogs import Narrowing


CatalogOutput = Annotated[list[str] | None, output_option(CATALOG_FORMATS)]


@guarded
def catalog_list(
    section: Annotated[
        str | None,
        typer.Argument(
            help="platforms, sensors, timestamping, infrastructure or clocks.",
            autocompletion=among(catalog_sections),
        ),
    ] = None,
    modality: Annotated[
        str | None,
        typer.Option(
            help="Sensors of this modality: position, attitude, ranging.",
            autocompletion=one_of(*ROLES),
        ),
    ] = None,
    kind: Annotated[
        str | None, typer.Option("--type", metavar="TYPE", help="Sensors of this type.")
    ] = None,
    reach: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Sensors that measure this far: 120 m.")
    ] = None,
    medium: Annotated[
        str | None,
        typer.Option(
            help="Sensors that measure through air or water.", autocompletion=one_of(*MEDIA)
        ),
    ] = None,
    max_cost: Annotated[
        str | None, typer.Option(metavar="MONEY", help="Sensors up to this price: 5000 EUR.")
    ] = None,
    output: CatalogOutput = None,
    quiet: QuietOption = False,
) -> int:
    """List what the built-in catalogs hold, or the sensors of them that fit."""
    from syncline_design.report.catalogs import SECTIONS, list_text, listed
    from syncline_design.report.json_out import json_text
    from syncline_design.spec.load import builtin_collection

    if section is not None and section not in SECTIONS:
        refuse(f"syncline-design: catalog list {section}: expected one of {', '.join(SECTIONS)}")
    wanted = _wanted(modality, kind, reach, medium, max_cost)
    if wanted.narrows and section not in (None, "sensors"):
        refuse(f"syncline-design: catalog list {section}: only sensors can be narrowed")
    targets = output_targets(output, CATALOG_FORMATS)
    collection = builtin_collection()
    catalog = collection.catalog()
    found = listed(catalog, collection.origins, section, wanted)
    text = list_text(catalog, found)
    emit(text, targets, lambda _: json_text(found.to_json()), quiet=quiet)
    return 0


def _wanted(
    modality: str | None,
    kind: str | None,
    reach: str | None,
    medium: str | None,
    max_cost: str | None,
) -> Narrowing:
    """What a list is narrowed to; a word or a figure that cannot be meant is refused."""
    from syncline_design.model.quantity import Dimension, UnitError, parse_quantity
    from syncline_design.report.catalogs import Narrowing

    for option, word, known in (
        ("--modality", modality, ROLES),
        ("--medium", medium, MEDIA),
    ):
        if word is not None and word not in known:
            refuse(f"syncline-design: {option} {word}: expected one of {', '.join(known)}")
    try:
        far = None if reach is None else parse_quantity(reach, Dimension.LENGTH, tolerance=False)
        most = (
            None if max_cost is None else parse_quantity(max_cost, Dimension.MONEY, tolerance=False)
        )
    except UnitError as error:
        refuse(f"syncline-design: catalog list: {error}")
    return Narrowing(modality, kind, far, medium, most)


@guarded
def catalog_show(
    identity: Annotated[str, typer.Argument(metavar="ID", autocompletion=among(catalog_ids))],
    output: CatalogOutput = None,
    quiet: QuietOption = False,
) -> int:
    """Show one catalog entry: figures, kinds, conversions, sources, assumptions."""
    from syncline_design.report.catalogs import entry_data, entry_text, suggestion
    from syncline_design.report.json_out import json_text
    from syncline_design.spec.load import builtin_collection

    targets = output_targets(output, CATALOG_FORMATS)
    collection = builtin_collection()
    catalog = collection.catalog()
    found = entry_data(catalog, collection.origins, identity)
    if found is None:
        refuse(
            f"syncline-design: catalog show {identity}: no such entry"
            f"{suggestion(catalog, identity)}"
        )
    emit(entry_text(found), targets, lambda _: json_text(found.to_json()), quiet=quiet)
    return 0


@guarded
def catalog_check(
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[FILE]...", help="Catalog files; without them, the built-in ones."),
    ] = None,
    output: CatalogOutput = None,
    quiet: QuietOption = False,
) -> int:
    """Look catalogs over: units, sources, conversions, siblings, ids, duplicates, lifecycle."""
    from syncline_design.report.catalogs import check_text
    from syncline_design.report.json_out import json_text
    from syncline_design.spec.catalog_check import check_catalogs

    targets = output_targets(output, CATALOG_FORMATS, files or ())
    for path in files or ():
        if not path.is_file():
            refuse(f"syncline-design: catalog check {path}: no such file")
    found = check_catalogs(files or ())
    emit(check_text(found), targets, lambda _: json_text(found.to_json()), quiet=quiet)
    return found.exit_code


@guarded
def catalog_add(
    kind: Annotated[
        str,
        typer.Option(
            "--from-template",
            metavar="TYPE",
            help="Kind of entry: lidar, gnss, ...",
            autocompletion=among(stub_types),
        ),
    ],
    to: Annotated[
        Path | None, typer.Option("--to", metavar="FILE", help="Catalog file that it is put into.")
    ] = None,
) -> int:
    """Write a stub of an entry, to be filled in from a data sheet."""
    from datetime import date

    from syncline_design.report.catalog_stub import STUB_TYPES, put_in, stub
    from syncline_design.report.write import OutputTarget, write_outputs

    if kind not in STUB_TYPES:
        refuse(f"syncline-design: --from-template {kind}: expected one of {', '.join(STUB_TYPES)}")
    day = date.today().isoformat()
    if to is None:
        section, text = stub(kind, day, lambda _, __: False)
        show(f"{section}:\n{text}")
        return 0
    before, sections = _catalog_there(to)
    section, text = stub(kind, day, lambda part, name: name in sections.get(part, {}))
    write_outputs([(OutputTarget("text", str(to)), put_in(before, section, text))])
    identity = text.partition(":")[0].strip()
    say(f"{identity} written to {to}: fill in every _, then syncline-design catalog check {to}")
    return 0


def _catalog_there(path: Path) -> tuple[str, dict[str, Any]]:
    """Text and data of the catalog that an entry is put into; nothing where there is none yet."""
    from syncline_design.spec.yaml_text import read

    if not path.exists():
        return "", {}
    document = read(path)
    sections = document.data
    lines = [line.strip() for line in document.text.splitlines()]
    if document.sha256 and all(not line or line.startswith("#") for line in lines):
        return document.text, {}
    if document.problems:
        refuse(f"{document.problems[0]}; mend it before something is added")
    if not isinstance(sections, dict) or not all(
        isinstance(entries, dict) for key, entries in sections.items() if key != "catalogs"
    ):
        refuse(f"{path}: not a catalog; mend it before something is added")
    return document.text, sections


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

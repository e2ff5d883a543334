"""``landing shapes``: find, look at, check, convert, resample and download shape models."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from landing_cli.cli import console
from landing_cli.cli.options import Force, Json, Output, Quiet, new_group
from landing_cli.errors import ExitCode, InputRefused, OutputRefused, UsageError

if TYPE_CHECKING:
    from landing_cli.body.mesh import Mesh
    from landing_cli.sources.shape_files import ShapeFile

app = new_group("Find, look at, check, convert, resample and download shape models.")


class Unit(StrEnum):
    """Length unit of the coordinates in a shape file."""

    KM = "km"
    M = "m"


def _complete_shape(incomplete: str) -> list[str]:
    from landing_cli.sources.shape_search import known_shapes

    return sorted({path.name for path in known_shapes() if path.name.startswith(incomplete)})


ShapeName = Annotated[
    str,
    typer.Argument(
        metavar="SHAPE",
        help="A path, or a name that `landing shapes list` shows.",
        autocompletion=_complete_shape,
    ),
]
UnitOption = Annotated[Unit, typer.Option("--unit", "--length-unit", help="Length unit of the file.")]
IndexBase = Annotated[
    int | None,
    typer.Option(
        min=0, max=1, metavar="0|1", help="What the facets count from; decided by the checks unless given."
    ),
]


@app.command("list")
def list_shapes(as_json: Json = False) -> None:
    """List the shapes in ., ./shapes, LANDING_REFERENCE_DATA/shapes, the checkout and the package."""
    from landing_cli.sources.shape_files import read_raw
    from landing_cli.sources.shape_search import known_shapes

    rows: list[dict[str, object]] = []
    for path in known_shapes():
        row: dict[str, object] = {"name": path.name, "vertices": None, "facets": None, "format": None}
        try:
            raw = read_raw(path)
            row |= {"vertices": len(raw.vertices), "facets": len(raw.faces), "format": raw.dialect}
        except InputRefused as error:
            row["format"] = f"not readable: {error.what}"
        rows.append(row | {"path": str(path)})
    if as_json:
        console.print_json(rows)
    else:
        console.print_table(list(rows[0]) if rows else ["name"], [list(row.values()) for row in rows])


@app.command()
def info(
    shape: ShapeName,
    unit: UnitOption = Unit.KM,
    index_base: IndexBase = None,
    reference_radius_m: Annotated[
        float | None,
        typer.Option(
            "--reference-radius",
            metavar="M",
            help="Radius of the gravity coefficients; that of the sphere of the same volume unless given.",
        ),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Print size, mass properties, ellipsoid and gravity coefficients of a shape."""
    from landing_cli.body.shape_facts import shape_facts
    from landing_cli.cli.shape_figures import facts_figures

    source = _read(shape, unit, index_base, quiet)
    facts = shape_facts(source.mesh, reference_radius_m)
    figures = {
        "path": str(source.path),
        "sha256": source.sha256,
        "format": source.dialect,
        "indices_from": source.index_base,
        **facts_figures(facts),
    }
    if as_json:
        console.print_json(figures)
        return
    console.print_table(["quantity", "value"], [[name, _shown(value)] for name, value in figures.items()])


@app.command()
def check(
    shape: ShapeName,
    unit: UnitOption = Unit.KM,
    index_base: IndexBase = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Check that a file is the surface of one body; exit 3 unless every check passes."""
    from landing_cli.body.mesh_checks import check_surface
    from landing_cli.sources.shape_files import index_base_of, read_raw
    from landing_cli.sources.shape_search import find_shape

    raw = read_raw(find_shape(shape))
    base = index_base_of(raw, unit.value) if index_base is None else index_base
    results = list(check_surface(raw.surface(unit.value, base)))
    sound = all(result.status == "passed" for result in results)
    voice = console.Console(quiet)
    voice.say(f"read {raw.path} ({raw.dialect}, facets count from {base}, {unit.value})")
    rows = [
        {
            "check": result.name,
            "status": result.status,
            "where": result.fault.where if result.fault else None,
            "what": result.fault.what if result.fault else None,
            "fix": result.fault.fix if result.fault else None,
        }
        for result in results
    ]
    if as_json:
        console.print_json({"path": str(raw.path), "sound": sound, "checks": rows})
    else:
        console.print_table(["check", "status"], [[result.name, result.status] for result in results])
    for result in results:
        if result.fault:
            fault = InputRefused(result.fault.what, where=result.fault.where, fix=result.fault.fix)
            voice.warn(f"{result.name}: {fault}")
    if not sound:
        raise typer.Exit(ExitCode.REFUSED)


@app.command("import")
def import_shape(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="OBJ or PDS vertex/facet table.")],
    unit: UnitOption,
    index_base: IndexBase = None,
    output: Output = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Check a file and write it as OBJ in km, about the same origin."""
    from landing_cli.sources.shape_files import read_shape

    shape = read_shape(source, unit.value, index_base)
    path = output or Path(f"{source.stem}.obj")
    _write(path, shape.mesh, _import_header(shape), force)
    console.Console(quiet).say(f"wrote {path}")


@app.command()
def resample(
    shape: ShapeName,
    vertices: Annotated[
        int, typer.Option("--vertices", "-n", metavar="N", help="Vertices; facets: 2 N - 4.")
    ],
    unit: UnitOption = Unit.KM,
    note: Annotated[
        list[str] | None,
        typer.Option(metavar="TEXT", help="Line for the head of the file, such as a credit. Repeatable."),
    ] = None,
    output: Output = None,
    force: Force = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Represent a star-shaped body by N vertices: even triangles, same volume, about the same origin.

    The new mesh is written as OBJ in km; its deviation from the source is printed.
    """
    from landing_cli.body.resample import resampled
    from landing_cli.cli.shape_figures import deviation_figures
    from landing_cli.sources.shape_files import rounded

    source = _read(shape, unit, None, quiet)
    path = output or Path(f"{source.path.stem}_{vertices}.obj")
    _refuse_existing(path, force)
    try:
        mesh = rounded(resampled(source.mesh, vertices))
    except InputRefused as error:
        where = f"{source.path}, {error.where}" if error.where else str(source.path)
        raise InputRefused(error.what, where=where, fix=error.fix) from error
    header = [
        *(note or ()),
        f"{len(mesh.vertices)} vertices, {len(mesh.faces)} facets, km, body frame, origin of the source",
        f"Resampled by `landing shapes resample` from {source.path.name}, sha256 {source.sha256}",
    ]
    _write(path, mesh, header, force)
    console.Console(quiet).say(f"wrote {path}")
    figures = {"path": str(path), **deviation_figures(source.mesh, mesh)}
    if as_json:
        console.print_json(figures)
    else:
        console.print_table(["quantity", "value"], [[name, _shown(value)] for name, value in figures.items()])


@app.command()
def fetch(
    body: Annotated[
        str | None, typer.Argument(metavar="[BODY]", help="bennu, bacchus or eros: the official file.")
    ] = None,
    url: Annotated[str | None, typer.Option(metavar="URL", help="Another file, http or https.")] = None,
    unit: Annotated[
        Unit | None, typer.Option("--unit", "--length-unit", help="Length unit of the file at --url.")
    ] = None,
    sha256: Annotated[
        str | None,
        typer.Option(metavar="HEX", help="What the file must be; recorded on first use unless given."),
    ] = None,
    folder: Annotated[Path, typer.Option("--into", metavar="FOLDER", help="Where to put it.")] = Path(
        "shapes"
    ),
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Download a shape model, check it, and write it as OBJ in km beside the download."""
    from landing_cli.sources.download import fetch_file
    from landing_cli.sources.shape_files import read_shape

    address, length_unit, published_hash = _address(body, url, unit)
    voice = console.Console(quiet)
    fetched = fetch_file(address, folder, sha256=sha256, published_hash=published_hash, force=force)
    voice.say(f"{'downloaded' if fetched.fresh else 'found'} {fetched.path} (sha256 {fetched.sha256})")
    shape = read_shape(fetched.path, length_unit.value)
    path = fetched.path.with_suffix(".obj")
    if path != fetched.path and (fetched.fresh or not path.exists()):
        _write(path, shape.mesh, [f"Downloaded from {address}", *_import_header(shape)], force)
        voice.say(f"wrote {path}")
    console.print_text(str(path))


def _address(body: str | None, url: str | None, unit: Unit | None) -> tuple[str, Unit, str | None]:
    """Tell the file to fetch, its unit, and its published hash."""
    from landing_cli.sources.shape_archive import OFFICIAL_SHAPES

    if (body is None) == (url is None):
        raise UsageError("name a body or a --url", fix=f"the bodies are {', '.join(OFFICIAL_SHAPES)}")
    if url is not None:
        if unit is None:
            raise UsageError("the length unit of the file at --url is not stated", fix="add --unit km or m")
        return url, unit, None
    official = OFFICIAL_SHAPES.get(str(body).lower())
    if official is None:
        raise UsageError(
            f"no official file is known for {body!r}",
            fix=f"the bodies are {', '.join(OFFICIAL_SHAPES)}; others by --url",
        )
    if unit is not None and unit.value != official.length_unit:
        raise UsageError(f"the file of {body} is in {official.length_unit}", fix="leave --unit out")
    return official.url, Unit(official.length_unit), official.published_hash


def _import_header(shape: ShapeFile) -> list[str]:
    return [
        f"{len(shape.mesh.vertices)} vertices, {len(shape.mesh.faces)} facets, km, body frame",
        f"Imported from {shape.path.name}: {shape.dialect}, {shape.length_unit}, from {shape.index_base}",
        f"sha256 of the source: {shape.sha256}",
    ]


def _read(shape: str, unit: Unit, index_base: int | None, quiet: bool) -> ShapeFile:
    from landing_cli.sources.shape_files import read_shape
    from landing_cli.sources.shape_search import find_shape

    found = read_shape(find_shape(shape), unit.value, index_base)
    console.Console(quiet).say(f"read {found.path}")
    return found


def _write(path: Path, mesh: Mesh, header: list[str], force: bool) -> None:
    from landing_cli.sources.shape_files import write_obj

    _refuse_existing(path, force)
    write_obj(path, mesh, header, "km")


def _refuse_existing(path: Path, force: bool) -> None:
    if path.exists() and not force:
        raise OutputRefused("is there already", where=str(path), fix="take another name, or --force")


def _shown(value: object) -> object:
    """Write a vector as three numbers, and a truth as a word."""
    if hasattr(value, "tolist"):
        return ", ".join(f"{number:.5g}" for number in value.tolist())
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value

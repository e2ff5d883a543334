"""``landing shapes``: find, look at, check, convert, resample and download shape models."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from landing_cli.cli import console
from landing_cli.cli.options import Force, Json, Output, Quiet, new_group
from landing_cli.errors import ExitCode, InputRefused, OutputRefused

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

    source = _read(shape, unit, index_base, quiet)
    facts = shape_facts(source.mesh, reference_radius_m)
    degree2, dipole, principal = facts.degree2, facts.dipole, facts.principal
    figures = {
        "path": str(source.path),
        "sha256": source.sha256,
        "format": source.dialect,
        "indices_from": source.index_base,
        "vertices": facts.vertex_count,
        "facets": facts.facet_count,
        "extents_m": facts.extents_m,
        "volume_km3": facts.mass.volume_m3 / 1e9,
        "area_km2": facts.area_m2 / 1e6,
        "mean_radius_m": facts.mass.mean_radius_m,
        "center_of_mass_m": facts.mass.center_of_mass_m,
        "principal_moments_m2": principal.moments_m2,
        "principal_axis_1_to_xyz_deg": principal.angles_deg[0],
        "principal_axis_2_to_xyz_deg": principal.angles_deg[1],
        "principal_axis_3_to_xyz_deg": principal.angles_deg[2],
        "ellipsoid_m": facts.ellipsoid_m,
        "mean_edge_m": facts.mean_edge_m,
        "longest_edge_m": facts.longest_edge_m,
        "equilateral_height_m": facts.equilateral_height_m,
        "reference_radius_m": degree2.reference_radius_m,
        "c20": degree2.c20,
        "c21": degree2.c21,
        "c22": degree2.c22,
        "s21": degree2.s21,
        "s22": degree2.s22,
        "dipole_mass_fraction": dipole.mass_fraction if dipole else None,
        "dipole_separation_m": dipole.separation_m if dipole else None,
        "star_shaped": facts.star_shaped,
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
        console.print_table(["check", "status"], [[row["check"], row["status"]] for row in rows])
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
    header = [
        f"{len(shape.mesh.vertices)} vertices, {len(shape.mesh.faces)} facets, km, body frame",
        f"Imported from {shape.path.name} ({shape.dialect}, facets from {shape.index_base}, {unit.value})",
        f"sha256 of the source: {shape.sha256}",
    ]
    _write(path, shape.mesh, header, force)
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
        *(note or []),
        f"{len(mesh.vertices)} vertices, {len(mesh.faces)} facets, km, body frame, origin of the source",
        f"Resampled by `landing shapes resample` from {source.path.name}, sha256 {source.sha256}",
    ]
    _write(path, mesh, header, force)
    console.Console(quiet).say(f"wrote {path}")
    figures = {"path": str(path), **_deviation_figures(source.mesh, mesh)}
    if as_json:
        console.print_json(figures)
    else:
        console.print_table(["quantity", "value"], [[name, _shown(value)] for name, value in figures.items()])


def _deviation_figures(source: Mesh, mesh: Mesh) -> dict[str, object]:
    """Compare a resampled mesh with its source."""
    import numpy as np

    from landing_cli.body.mass_properties import mass_properties
    from landing_cli.body.surface_deviation import radial_deviation, triangle_quality

    old, new = mass_properties(source), mass_properties(mesh)
    forth = radial_deviation(source, mesh, old.center_of_mass_m)
    back = radial_deviation(mesh, source, old.center_of_mass_m)
    quality = triangle_quality(mesh)
    return {
        "vertices": len(mesh.vertices),
        "facets": len(mesh.faces),
        "source_to_new_rms_m": forth.rms_m,
        "source_to_new_max_m": forth.greatest_m,
        "new_to_source_rms_m": back.rms_m,
        "new_to_source_max_m": back.greatest_m,
        "volume_ratio_minus_1": new.volume_m3 / old.volume_m3 - 1.0,
        "center_of_mass_m": new.center_of_mass_m,
        "center_of_mass_shift_m": float(np.linalg.norm(new.center_of_mass_m - old.center_of_mass_m)),
        "extents_m": np.ptp(mesh.vertices, axis=0),
        "least_angle_deg": quality.least_angle_deg,
        "greatest_angle_deg": quality.greatest_angle_deg,
        "greatest_edge_ratio": quality.greatest_edge_ratio,
        "longest_over_mean_edge": quality.longest_over_mean_edge,
    }


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

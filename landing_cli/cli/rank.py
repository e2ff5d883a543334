"""``reach rank``: landing sites of a reach run in order of a stated score."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from landing_cli.cli import console
from landing_cli.cli.options import Force, Json, Quiet, ResultFile
from landing_cli.errors import InputRefused, OutputRefused, UsageError

if TYPE_CHECKING:
    from landing_cli.studies.rank.score import Ranking


class SlopeGravity(StrEnum):
    """The field that slopes are measured against."""

    RUN = "run"
    POLYHEDRON = "polyhedron"


def rank(
    run: ResultFile,
    case: Annotated[
        str | None,
        typer.Option("--case", metavar="NAME", help="One case; unless given the worst over all counts."),
    ] = None,
    weight: Annotated[
        list[str] | None,
        typer.Option(
            "--weight",
            metavar="NAME=W[,...]",
            help="Weights of margin, delta_v, slope and roughness; 1 each unless given. Repeatable.",
        ),
    ] = None,
    radius_m: Annotated[
        float | None,
        typer.Option(
            "--radius-m",
            metavar="M",
            help="Radius of the ground whose roughness counts, m; 3 mean edges unless given.",
        ),
    ] = None,
    top: Annotated[int, typer.Option("--top", min=1, metavar="N", help="How many sites to list.")] = 10,
    spacing_m: Annotated[
        float | None,
        typer.Option(
            "--spacing-m",
            metavar="M",
            help="Least distance between listed sites, m; the radius unless given, 0 lists neighbours too.",
        ),
    ] = None,
    gravity: Annotated[
        SlopeGravity,
        typer.Option("--gravity", help="Slopes are against the run's own gravity, or the polyhedron's."),
    ] = SlopeGravity.RUN,
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "--output",
            "-o",
            metavar="PATH",
            help="Also write .csv or .json (the sites), .png, .ply, .vtp or .obj (the map). Repeatable.",
        ),
    ] = None,
    force: Force = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Rank the landing sites of a reach run: thrust margin, delta-v, slope, roughness.

    Every measure counts from 0 for the worst candidate to 1 for the best, times its weight. Candidates are
    the facets that every case reaches by a path that does not cut the mesh.
    """
    weights = _weights(weight or ())
    _check_lengths(radius_m, spacing_m)
    paths = _checked_outputs(output or (), run, force)
    from landing_cli.reach.exports import chosen_cases
    from landing_cli.reach.stored import run_from_result
    from landing_cli.results.store import read
    from landing_cli.studies.rank.score import Wishes, check_weights, rank_sites

    found = run_from_result(read(run))
    wishes = Wishes(check_weights(weights), radius_m, spacing_m, top, gravity.value)
    ranking = rank_sites(chosen_cases(found, case), wishes)
    voice = console.Console(quiet)
    for line in _remarks(ranking):
        voice.say(line)
    _write(ranking, paths, voice)
    _print(ranking, run, as_json)


def _remarks(ranking: Ranking) -> list[str]:
    cases = ranking.cases[0].case.name if len(ranking.cases) == 1 else f"all {len(ranking.cases)} cases"
    lines = [
        f"{ranking.candidates.sum()} candidates: reachable in {cases}",
        f"margin: {ranking.margin}; slope against {ranking.gravity} gravity and the spin; roughness within "
        f"{ranking.radius_m:.4g} m; sites at least {ranking.spacing_m:.4g} m apart",
    ]
    if ranking.through_rock:
        lines.append(f"{ranking.through_rock} facets are left out: a path to them cuts the mesh")
    return lines


def _print(ranking: Ranking, run: Path, as_json: bool) -> None:
    from landing_cli.studies.rank.exports import sites_table

    table = sites_table(ranking)
    name = ranking.cases[0].case.asteroid.name
    if not as_json:
        rows = [list(row.values()) for row in table.rows()]
        console.print_table(list(table.columns), rows, title=f"Landing sites: {name}")
        return
    console.print_json(
        {
            "run": str(run),
            "scenario": name,
            "cases": [result.case.name for result in ranking.cases],
            "weights": ranking.weights,
            "margin": ranking.margin,
            "gravity": ranking.gravity,
            "radius_m": ranking.radius_m,
            "spacing_m": ranking.spacing_m,
            "candidates": int(ranking.candidates.sum()),
            "paths_through_rock": ranking.through_rock,
            "sites": table.rows(),
        }
    )


def _write(ranking: Ranking, paths: list[Path], voice: console.Console) -> None:
    from landing_cli.results import plotting
    from landing_cli.results.disk import replace_file
    from landing_cli.studies.rank.exports import MAPS, to_map, to_text

    for path in paths:
        form = path.suffix[1:].lower()
        if form == "png":
            from landing_cli.studies.rank.figures import rank_figure

            with plotting.style():
                plotting.write_png(rank_figure(ranking), path)
        else:
            data = to_map(ranking, form) if form in MAPS else to_text(ranking, form).encode()
            replace_file(path, data)
        voice.say(f"wrote {path}")


def _weights(texts: list[str] | tuple[()]) -> dict[str, float]:
    """Read ``margin=1,delta_v=2``."""
    from landing_cli.scenario.messages import did_you_mean

    names = ("margin", "delta_v", "slope", "roughness")
    found: dict[str, float] = {}
    for part in (part.strip() for text in texts for part in text.split(",")):
        name, separator, value = part.partition("=")
        if not separator:
            fix = "for instance --weight margin=2,roughness=0.5"
            raise UsageError(f"{part[:60]!r} is not of the form name=weight", where="--weight", fix=fix)
        if name not in names:
            raise UsageError(f"{name[:60]!r} is no measure", where="--weight", fix=did_you_mean(name, names))
        if name in found:
            raise UsageError(f"{name} has two weights", where="--weight", fix="give one")
        try:
            found[name] = float(value)
        except ValueError:
            raise UsageError(f"{value[:60]!r} is no number", where=f"--weight {name}") from None
    return found


def _check_lengths(radius_m: float | None, spacing_m: float | None) -> None:
    if radius_m is not None and not 0.0 < radius_m < 1e9:
        raise UsageError(f"{radius_m:g} is no radius", where="--radius-m", fix="give a length in m")
    if spacing_m is not None and not 0.0 <= spacing_m < 1e9:
        raise UsageError(f"{spacing_m:g} is no distance", where="--spacing-m", fix="give a length in m, or 0")


def _checked_outputs(paths: list[Path] | tuple[()], run: Path, force: bool) -> list[Path]:
    """Refuse, before anything is computed, what cannot be written or must not be lost."""
    forms = ("csv", "json", "png", "ply", "vtp", "obj")
    for path in paths:
        if path.suffix[1:].lower() not in forms:
            fix = f"end it in one of {', '.join(f'.{form}' for form in forms)}"
            raise UsageError(f"'{path.suffix}' tells no format", where=str(path), fix=fix)
        if path.exists() and run.exists() and path.samefile(run):
            raise InputRefused("is the run that is ranked", where=str(path), fix="take another name")
        if path.exists() and not force:
            raise OutputRefused("is there already", where=str(path), fix="take another name, or --force")
    return list(paths)

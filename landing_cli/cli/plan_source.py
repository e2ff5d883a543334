"""Where a plan command takes its scenario from: a file, or the result of a reach run."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from landing_cli.cli.console import Console
from landing_cli.errors import InputRefused, UsageError

if TYPE_CHECKING:
    from landing_cli.plan.pipeline import Request
    from landing_cli.reach.stored import CaseResult, ReachRun

_NUMBER = r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*"
_FACET = re.compile(r"facet:([0-9]{1,9})")
_LON_LAT = re.compile(f"{_NUMBER},{_NUMBER}")
_FREE = re.compile(f"{_NUMBER},{_NUMBER},{_NUMBER}:{_NUMBER},{_NUMBER},{_NUMBER}")


@dataclass(frozen=True)
class Source:
    """What the command line says about where the numbers come from.

    Attributes
    ----------
    scenario : str or None
        A scenario's name.
    from_run : Path or None
        A reach result, instead.
    case : str or None
        One of its cases.
    facet : int or None
        Where to land.
    site : str or None
        The same, in one of three forms.
    overrides : tuple of str
        ``key=value`` each.
    """

    scenario: str | None
    from_run: Path | None
    case: str | None
    facet: int | None
    site: str | None
    overrides: tuple[str, ...]


def request_of_source(command: str, source: Source, voice: Console) -> Request:
    """Read the scenario, or make one of a reach result, and build its body and spacecraft.

    Parameters
    ----------
    command : str
        With every option that decides the numbers.
    source : Source
        From the command line.
    voice : Console
        Told what was read.

    Returns
    -------
    Request

    Raises
    ------
    UsageError
        The options contradict each other.
    InputRefused
        The scenario or the result is refused.
    """
    overrides = [*_site_overrides(source), *source.overrides]
    if source.from_run is not None:
        return _request_of_run(command, source, overrides, voice)
    if source.scenario is None:
        raise UsageError("no scenario", fix="name one, or take one from a reach result with --from-run")
    if source.case is not None:
        raise UsageError("--case chooses among the cases of a reach result", fix="add --from-run")
    from landing_cli.plan.pipeline import request_of
    from landing_cli.scenario.load import load
    from landing_cli.scenario.sections import plan_section

    loaded = load(source.scenario, overrides)
    voice.say(f"read {loaded.source}")
    plan_section(loaded)  # before the shape is read
    return request_of(command, loaded, voice.say)


def site_override(text: str, section: str = "plan") -> str:
    """Turn ``--site`` into the scenario key that it stands for.

    Parameters
    ----------
    text : str
        ``facet:17``, ``lon,lat`` in degrees, or ``x,y,z:nx,ny,nz`` in metres.
    section : {"plan", "observe"}
        Of the scenario.

    Returns
    -------
    str
        ``plan.site=...``.

    Raises
    ------
    UsageError
        It is of none of the three forms.
    """
    if found := _FACET.fullmatch(text):
        return f"{section}.site={{facet: {found[1]}}}"
    if found := _FREE.fullmatch(text):
        position, normal = ", ".join(found.groups()[:3]), ", ".join(found.groups()[3:])
        return f"{section}.site={{position_m: [{position}], normal: [{normal}]}}"
    if found := _LON_LAT.fullmatch(text):
        return f"{section}.site={{lon_lat_deg: [{found[1]}, {found[2]}]}}"
    raise UsageError(
        f"{text[:60]!r} is no site",
        where="--site",
        fix="write facet:17, LON,LAT in degrees, or X,Y,Z:NX,NY,NZ in metres (position and normal)",
    )


def _site_overrides(source: Source) -> list[str]:
    if source.site is not None and source.facet is not None:
        raise UsageError("--site and --facet both name the site", fix="give one of them")
    if source.facet is not None:
        return [site_override(f"facet:{source.facet}")]
    return [] if source.site is None else [site_override(source.site)]


def _request_of_run(command: str, source: Source, overrides: Sequence[str], voice: Console) -> Request:
    if source.scenario is not None:
        raise UsageError(
            "a scenario beside --from-run",
            where=source.scenario,
            fix="leave it out: the result brings all but the plan.KEYs, which --set changes",
        )
    if source.facet is None and source.site is None:
        raise UsageError("--from-run needs a site", fix="add --facet N, or --site")
    foreign = [text for text in source.overrides if text.startswith(("body", "reach"))]
    if foreign:
        raise UsageError(f"--set {foreign[0]} with --from-run", fix="body and reach are those of the run")
    from landing_cli.plan.pipeline import Request
    from landing_cli.reach.stored import run_from_result
    from landing_cli.results.store import read
    from landing_cli.scenario.build import build_spacecraft
    from landing_cli.scenario.document import Document, parse
    from landing_cli.scenario.load import load_document

    assert source.from_run is not None
    result = read(source.from_run)
    run = run_from_result(result)
    chosen = _chosen(run, source)
    voice.say(f"read {source.from_run}: case {chosen.case.name}")
    tree = dict(parse(result.identity.scenario, str(source.from_run)).tree)
    tree.pop("reach", None)
    state = {
        "position_m": chosen.case.position_m.tolist(),
        "velocity_m_s": chosen.case.velocity_m_s.tolist(),
    }
    tree["plan"] = {"initial_state": state, "site": {"facet": 0}, "tof_s": [chosen.case.tof_s]}
    loaded = load_document(Document(tree, {}), str(source.from_run), source.from_run.parent, overrides)
    craft = build_spacecraft(loaded.scenario)
    return Request(command, loaded, run.asteroid, craft, result.identity.shape_sha256)


def _chosen(run: ReachRun, source: Source) -> CaseResult:
    """Take the case of a name, the only one, or the one that reaches the facet with the least propellant."""
    from landing_cli.reach.exports import chosen_cases
    from landing_cli.reach.records import Verdict

    cases = chosen_cases(run, source.case)
    if len(cases) == 1:
        return cases[0]
    names = ", ".join(result.case.name for result in cases)
    if source.facet is None:
        raise UsageError(
            "the run has several cases", where="--from-run", fix=f"choose one with --case: {names}"
        )
    best: tuple[float, CaseResult] | None = None
    for result in cases:
        rows = result.solutions.rows
        own = rows[(rows["facet"] == source.facet) & (rows["verdict"] == Verdict.REACHABLE)]
        if len(own) and (best is None or own["fuel_kg"][0] < best[0]):
            best = float(own["fuel_kg"][0]), result
    if best is None:
        raise InputRefused(
            f"facet {source.facet} is reachable in no case of the run",
            where=str(source.from_run),
            fix=f"choose another facet, or a case with --case: {names}",
        )
    return best[1]

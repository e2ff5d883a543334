"""A dispersion as a tree on disk, and back, held to what a run can have found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.errors import InputRefused
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.records import LandingCase, Verdict
from landing_cli.reach.stored import case_from_attributes, case_to_attributes
from landing_cli.results.body_checks import check_spacecraft
from landing_cli.results.body_group import body_from_group, body_to_group, number
from landing_cli.results.store import StoredResult
from landing_cli.results.tree import (
    Dataset,
    Group,
    flag_words,
    group_to_mapping,
    mapping_to_group,
    table_group,
    table_rows,
)
from landing_cli.studies.disperse.records import (
    FACET_COLUMNS,
    SAMPLE_COLUMNS,
    Axes,
    CaseDispersion,
    DispersionRun,
    Drawing,
    Spread,
)
from landing_cli.studies.disperse.stored_checks import check_case, check_drawing

MISSION = "dispersion"

_SIGMAS = ("mass_sigma_kg", "thrust_sigma_n", "gm_sigma_m3_s2")
_SIDES = ("row", "column")


def run_to_tree(run: DispersionRun) -> Group:
    """Lay a run out for the store.

    Parameters
    ----------
    run : DispersionRun
        With at least one case.

    Returns
    -------
    Group
        With the groups ``body``, ``spacecraft``, ``drawing`` and ``cases``.
    """
    craft = {name: value for name, value in vars(run.spacecraft).items() if value is not None}
    cases = {c.case.name: _case_to_group(c, order) for order, c in enumerate(run.cases)}
    members = {
        "body": body_to_group(run.asteroid),
        "spacecraft": Group({}, craft),
        "drawing": _drawing_to_group(run.drawing),
        "cases": Group(cases),
    }
    return Group(members, {"mission": MISSION})


def run_from_result(result: StoredResult) -> DispersionRun:
    """Rebuild a run from its file.

    Parameters
    ----------
    result : StoredResult
        As it was read.

    Returns
    -------
    DispersionRun
        Equal to the run that was stored.

    Raises
    ------
    InputRefused
        If the file is of another mission, lacks a part, or holds what no run can have found.
    """
    if result.mission != MISSION:
        told = f"holds a result of '{result.mission}', not of '{MISSION}'"
        raise InputRefused(told, where=str(result.path), fix="name a file that `reach disperse` wrote")
    try:
        return _run_from_tree(result.tree)
    except (KeyError, ValueError, TypeError, IndexError, OverflowError, InputRefused) as error:
        told = f"lacks a part or holds a wrong one: {error}"
        fix = "run again with --force, or use the version that wrote it"
        raise InputRefused(told, where=str(result.path), fix=fix) from error


def _run_from_tree(tree: Group) -> DispersionRun:
    asteroid = body_from_group(tree.group("body"))
    craft = Spacecraft(**tree.group("spacecraft").attributes)  # type: ignore[arg-type]
    check_spacecraft(craft)
    drawing = _drawing_from_group(tree.group("drawing"))
    check_drawing(drawing, asteroid, craft)
    groups = {name: tree.group("cases", name) for name in tree.group("cases").members}
    ordered = sorted(groups, key=lambda name: number(groups[name], "order"))
    cases = tuple(_case_from_group(name, groups[name], asteroid, craft, drawing) for name in ordered)
    if not cases:
        raise ValueError("no case")
    for case in cases:
        check_case(case)
    return DispersionRun(cases)


def _drawing_to_group(drawing: Drawing) -> Group:
    spread = drawing.spread
    told = "lower triangular L of the covariance L L' of position (m) and velocity (m/s) along the axes"
    return Group(
        {"state_factor": Dataset(spread.state_factor, "1", told, _SIDES)},
        {
            "seed": drawing.seed,
            "samples": drawing.samples,
            "confidence": drawing.confidence,
            "axes": spread.axes,
            **{name: getattr(spread, name) for name in _SIGMAS},
        },
    )


def _drawing_from_group(group: Group) -> Drawing:
    seed, samples = group.attributes["seed"], group.attributes["samples"]
    axes: Any = group.attributes["axes"]
    if axes not in get_args(Axes) or type(seed) is not int or type(samples) is not int:
        raise ValueError("the drawing's axes, seed or samples are none")
    spread = Spread(
        axes,
        group.dataset("state_factor").data,
        *(float(number(group, name)) for name in _SIGMAS),
    )
    return Drawing(seed, samples, float(number(group, "confidence")), spread)


def _case_to_group(result: CaseDispersion, order: int) -> Group:
    told = "what is known about each facet in each sample"
    members: dict[str, Dataset | Group] = {
        "facets": table_group(result.facets, FACET_COLUMNS, "facet"),
        "samples": table_group(result.samples, SAMPLE_COLUMNS, "sample"),
        "verdicts": Dataset(result.verdicts, "1", told, ("sample", "facet"), flag_words(Verdict)),
        "summary": mapping_to_group(result.summary),
    }
    if result.lost:
        members["lost"] = _lost_to_group(result.lost)
    attributes = {"order": order, "initial_state": result.initial_state, **case_to_attributes(result.case)}
    return Group(members, attributes)


def _case_from_group(
    name: str, group: Group, asteroid: Asteroid, craft: Spacecraft, drawing: Drawing
) -> CaseDispersion:
    case: LandingCase = case_from_attributes(name, group, asteroid, craft)
    return CaseDispersion(
        case,
        str(group.attributes["initial_state"]),
        drawing,
        _verdicts(group.dataset("verdicts").data, drawing, case),
        table_rows(group.group("samples"), SAMPLE_COLUMNS),
        table_rows(group.group("facets"), FACET_COLUMNS),
        group_to_mapping(group.group("summary")),
        _lost_from_group(group.group("lost")) if "lost" in group.members else {},
    )


def _verdicts(data: NDArray[Any], drawing: Drawing, case: LandingCase) -> NDArray[np.uint8]:
    if data.dtype != np.uint8 or data.shape != (drawing.samples, len(case.asteroid.mesh.faces)):
        raise ValueError(f"verdicts are {data.dtype} {data.shape}")
    return data


def _lost_to_group(lost: Mapping[tuple[int, int], str]) -> Group:
    pairs = np.array(sorted(lost), dtype=np.int32)
    reasons = np.array([lost[sample, facet] for sample, facet in pairs.tolist()])
    return Group(
        {
            "sample": Dataset(pairs[:, 0], "1", "samples that could not be solved", ("pair",)),
            "facet": Dataset(pairs[:, 1], "1", "and their facets", ("pair",)),
            "reason": Dataset(reasons, "1", "why", ("pair",)),
        }
    )


def _lost_from_group(group: Group) -> dict[tuple[int, int], str]:
    samples, facets, reasons = (group.dataset(name).data.tolist() for name in ("sample", "facet", "reason"))
    return {(s, f): str(r) for s, f, r in zip(samples, facets, reasons, strict=True)}

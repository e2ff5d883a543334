"""A reach run as a tree on disk, and a chunk of its facets as a journal record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.errors import InputRefused
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.records import (
    FACET_COLUMNS,
    FACET_DTYPE,
    FacetSolutions,
    FreeFinalStage,
    LandingCase,
)
from landing_cli.reach.stored_checks import check_case
from landing_cli.results.body_checks import check_spacecraft
from landing_cli.results.body_group import body_from_group, body_to_group, number, vector
from landing_cli.results.store import StoredResult
from landing_cli.results.tree import (
    Dataset,
    Group,
    group_to_mapping,
    mapping_to_group,
    table_group,
    table_rows,
)

MISSION = "reach"

_CASE_NUMBERS = ("tof_s", "final_stage_s", "glide_slope_half_angle_rad")
_CASE_VECTORS = ("position_m", "velocity_m_s", "ellipsoid_m")
_CASE_CHOICES = ("handover", "final_stage_thrust", "descent", "terrain")


@dataclass(frozen=True, eq=False)
class CaseResult:
    """What a run found for one case.

    Attributes
    ----------
    case : LandingCase
    initial_state : str
        Name of the initial state.
    solutions : FacetSolutions
        In ascending facet order.
    summary : mapping
        Numbers, text and mappings of them, as printed.
    boundary : Group or None
        Datasets over the dimension ``point`` where a section or a tracer found the boundary.
    level_set : Group or None
        The lines on the surface where the least thrust level is 1; see ``level_set``.
    lost : mapping of int to str
        Why a facet could not be solved, by facet.
    """

    case: LandingCase
    initial_state: str
    solutions: FacetSolutions
    summary: Mapping[str, Any] = field(default_factory=dict)
    boundary: Group | None = None
    lost: Mapping[int, str] = field(default_factory=dict)
    level_set: Group | None = None


@dataclass(frozen=True, eq=False)
class ReachRun:
    """A reach run: every case of one spacecraft over one asteroid.

    Attributes
    ----------
    cases : tuple of CaseResult
        At least one, in the scenario's order.
    """

    cases: tuple[CaseResult, ...]

    @property
    def asteroid(self) -> Asteroid:
        """The asteroid that all cases share."""
        return self.cases[0].case.asteroid

    @property
    def spacecraft(self) -> Spacecraft:
        """The spacecraft that all cases share."""
        return self.cases[0].case.spacecraft

    @property
    def lost_facets(self) -> int:
        """How many facets of all cases could not be solved."""
        return sum(len(case.lost) for case in self.cases)


def solutions_to_arrays(solutions: FacetSolutions) -> dict[str, NDArray[Any]]:
    """Encode solutions for the journal.

    Parameters
    ----------
    solutions : FacetSolutions
        Of a chunk of facets.

    Returns
    -------
    dict of arrays
    """
    return {"rows": solutions.rows, "thrust_nodes_n": solutions.thrust_nodes_n}


def solutions_from_arrays(arrays: Mapping[str, NDArray[Any]]) -> FacetSolutions:
    """Decode what ``solutions_to_arrays`` encoded.

    Parameters
    ----------
    arrays : mapping of arrays
        A journal record.

    Raises
    ------
    InputRefused
        If it is not of this version's types and shapes.
    """
    rows, nodes = arrays.get("rows"), arrays.get("thrust_nodes_n")
    if rows is None or nodes is None or rows.dtype != FACET_DTYPE or nodes.dtype != np.float64:
        raise _unfit("a journal record holds other columns than this version writes")
    if (rows["thrust_nodes"] < 0).any():
        raise _unfit("a journal record holds a negative number of thrust nodes")
    if rows.ndim != 1 or nodes.shape != (rows["thrust_nodes"].sum(dtype=np.int64), 3):
        raise _unfit("a journal record's thrust nodes do not fit its rows")
    return FacetSolutions(rows, nodes)


def case_to_attributes(case: LandingCase) -> dict[str, Any]:
    """Return what a case asks, as attributes of its group; body and spacecraft are stored apart."""
    names = (*_CASE_NUMBERS, *_CASE_VECTORS, *_CASE_CHOICES)
    attributes: dict[str, Any] = {name: getattr(case, name) for name in names} | {"margin": int(case.margin)}
    if case.free_final_stage is not None:
        known = {name: value for name, value in vars(case.free_final_stage).items() if value is not None}
        attributes |= {f"final_stage_{name}": value for name, value in known.items()}
    return attributes


def case_from_attributes(name: str, group: Group, asteroid: Asteroid, craft: Spacecraft) -> LandingCase:
    """Rebuild a case from the attributes of its group.

    Parameters
    ----------
    name : str
        Of the case.
    group : Group
        With the attributes of ``case_to_attributes``.
    asteroid, craft : Asteroid, Spacecraft
        As they were stored.

    Returns
    -------
    LandingCase

    Raises
    ------
    KeyError, ValueError
        If an attribute is missing, or of another type.
    """
    facts: dict[str, Any] = {key: number(group, key) for key in _CASE_NUMBERS}
    facts |= {key: vector(group, key) for key in _CASE_VECTORS}
    facts |= {key: str(group.attributes[key]) for key in _CASE_CHOICES}
    facts["margin"] = number(group, "margin") != 0
    if "final_stage_shortest_s" in group.attributes:
        keys = ("shortest_s", "longest_s", "compared_s")
        known = {
            key: number(group, f"final_stage_{key}")
            for key in keys
            if f"final_stage_{key}" in group.attributes
        }
        facts["free_final_stage"] = FreeFinalStage(**known)
    return LandingCase(name, asteroid, craft, **facts)


def run_to_tree(run: ReachRun) -> Group:
    """Lay a run out for the store.

    Parameters
    ----------
    run : ReachRun
        With at least one case.

    Returns
    -------
    Group
        With the groups ``body``, ``spacecraft`` and ``cases``.
    """
    craft = {name: value for name, value in vars(run.spacecraft).items() if value is not None}
    cases = {c.case.name: _case_to_group(c, order) for order, c in enumerate(run.cases)}
    return Group(
        {
            "body": body_to_group(run.asteroid),
            "spacecraft": Group({}, craft),
            "cases": Group(cases),
        },
        {"mission": MISSION},
    )


def run_from_result(result: StoredResult) -> ReachRun:
    """Rebuild a run from its file.

    Parameters
    ----------
    result : StoredResult
        As it was read.

    Returns
    -------
    ReachRun
        Equal to the run that was stored.

    Raises
    ------
    InputRefused
        If the file is of another mission, lacks a part, or holds what no run can have found.
    """
    if result.mission != MISSION:
        told = f"holds a result of '{result.mission}', not of '{MISSION}'"
        raise InputRefused(told, where=str(result.path), fix="name a file that `reach run` wrote")
    try:
        return _run_from_tree(result.tree)
    except (KeyError, ValueError, TypeError, IndexError, OverflowError) as error:
        raise _unfit(f"lacks a part or holds a wrong one: {error}", str(result.path)) from error


def _run_from_tree(tree: Group) -> ReachRun:
    asteroid = body_from_group(tree.group("body"))
    craft = Spacecraft(**tree.group("spacecraft").attributes)  # type: ignore[arg-type]
    check_spacecraft(craft)
    groups = {name: tree.group("cases", name) for name in tree.group("cases").members}
    ordered = sorted(groups, key=lambda name: number(groups[name], "order"))
    cases = tuple(_case_from_group(name, groups[name], asteroid, craft) for name in ordered)
    if not cases:
        raise ValueError("no case")
    for case in cases:
        check_case(case)
    return ReachRun(cases)


def _case_to_group(result: CaseResult, order: int) -> Group:
    solutions = result.solutions
    attributes: dict[str, Any] = {"order": order, "initial_state": result.initial_state}
    attributes |= case_to_attributes(result.case)
    members: dict[str, Dataset | Group] = {
        "facets": table_group(solutions.rows, FACET_COLUMNS, "facet"),
        "trajectories": _trajectories_to_group(solutions),
        "summary": mapping_to_group(result.summary),
    }
    if result.boundary is not None:
        members["boundary"] = result.boundary
    if result.level_set is not None:
        members["level_set"] = result.level_set
    if result.lost:
        facets = np.array(sorted(result.lost), dtype=np.int32)
        reasons = np.array([result.lost[facet] for facet in facets.tolist()])
        members["lost"] = Group(
            {
                "facet": Dataset(facets, "1", "facets that could not be solved", ("facet",)),
                "reason": Dataset(reasons, "1", "why", ("facet",)),
            }
        )
    return Group(members, attributes)


def _trajectories_to_group(solutions: FacetSolutions) -> Group:
    told = "descent thrust, constant over equal intervals, in inertial axes equal to the body's at handover"
    where = "row i of facets owns thrust_nodes_n[node_offsets[i]:node_offsets[i + 1]]"
    return Group(
        {
            "thrust_nodes_n": Dataset(solutions.thrust_nodes_n, "N", told, ("node", "xyz")),
            "node_offsets": Dataset(solutions.node_offsets, "1", where, ("offset",)),
        }
    )


def _case_from_group(name: str, group: Group, asteroid: Asteroid, craft: Spacecraft) -> CaseResult:
    rows = table_rows(group.group("facets"), FACET_COLUMNS)
    nodes = group.group("trajectories").dataset("thrust_nodes_n").data
    solutions = solutions_from_arrays({"rows": rows, "thrust_nodes_n": nodes})
    lost: dict[int, str] = {}
    if "lost" in group.members:
        table = group.group("lost")
        facets, reasons = table.dataset("facet").data.tolist(), table.dataset("reason").data.tolist()
        lost = dict(zip(facets, reasons, strict=True))
    return CaseResult(
        case_from_attributes(name, group, asteroid, craft),
        str(group.attributes["initial_state"]),
        solutions,
        group_to_mapping(group.group("summary")),
        group.group("boundary") if "boundary" in group.members else None,
        lost,
        group.group("level_set") if "level_set" in group.members else None,
    )


def _unfit(what: str, where: str = "") -> InputRefused:
    return InputRefused(what, where=where, fix="run again with --force, or use the version that wrote it")

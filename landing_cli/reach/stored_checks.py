"""Whether a stored run can be true: what compiled code and printers take for granted, asked of every file."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.boundary_lines import lines_from_group
from landing_cli.reach.records import FACET_COLUMNS, FacetSolutions, LandingCase, Verdict
from landing_cli.reach.summary import summarise
from landing_cli.results.body_checks import bounded, positive
from landing_cli.results.tree import Dataset, Group

if TYPE_CHECKING:
    from landing_cli.reach.stored import CaseResult

# what a scenario may ask for at most, or an answer to one may be
_LARGEST = {
    "tof_s": 1e7,
    "final_stage_s": 1e7,
    "position_m": 1e9,
    "velocity_m_s": 1e6,
    "ellipsoid_m": 1e9,
    "handover_position_m": 1e9,
    "handover_velocity_m_s": 1e6,
    "costates": 1e12,
    "thrust_nodes_n": 1e7,
}
_SECTION_LISTS = frozenset({"section_facets", "ring_facets", "expansion_facets", "boundary_facets"})
_CHOICES = {n: get_args(h) for n, h in get_type_hints(LandingCase).items() if get_origin(h) is Literal}


def check_case(result: CaseResult) -> None:
    """Hold a case to what can have been asked and answered.

    Parameters
    ----------
    result : CaseResult
        As it was read.

    Raises
    ------
    ValueError
        If a quantity is impossible, a choice unknown, or a facet not of this body.
    """
    case, facets = result.case, len(result.case.asteroid.mesh.faces)
    for name in ("tof_s", "final_stage_s", "ellipsoid_m"):
        positive(name, getattr(case, name), _LARGEST[name])
    if not case.descent_s > 0.0:
        raise ValueError("final_stage_s is longer than tof_s")
    if not 0.0 < case.glide_slope_half_angle_rad <= pi / 2:
        raise ValueError("glide_slope_half_angle_rad is not between 0 and pi/2")
    for name in ("position_m", "velocity_m_s"):
        bounded(name, getattr(case, name), _LARGEST[name])
    check_choices(case)
    check_rows(result.solutions, facets)
    _all_within("lost", np.array(list(result.lost), dtype=np.int64), facets)
    _check_final_stages(result)
    if result.boundary is not None:
        _check_boundary(result.boundary, facets)
    if result.boundary is not None and ("loop" in result.boundary.members or "trace" in result.summary):
        _check_trace(result, result.boundary)
    if result.level_set is not None:
        lines_from_group(result.level_set)
    check_printable("summary", result.summary)
    check_summary(result.summary, summarise(case.asteroid.mesh, result.solutions))


def check_choices(case: LandingCase) -> None:
    """Hold the words of a case to those that are known, or raise ValueError."""
    for name, allowed in _CHOICES.items():
        if getattr(case, name) not in allowed:
            raise ValueError(f"{name} is none of {', '.join(allowed)}")


def check_rows(solutions: FacetSolutions, facets: int) -> None:
    """Hold rows to facets that exist, each once, ascending, and to enumerations that are known.

    Parameters
    ----------
    solutions : FacetSolutions
        Rows whose types have been checked.
    facets : int
        How many there are.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """
    rows = solutions.rows
    _all_within("facet", rows["facet"], facets)
    if (np.diff(rows["facet"].astype(np.int64)) <= 0).any():
        raise ValueError("the facets do not ascend")
    if (rows["thrust_nodes"] < 0).any():
        raise ValueError("a facet has a negative number of thrust nodes")
    bounded("thrust_nodes_n", solutions.thrust_nodes_n, _LARGEST["thrust_nodes_n"])
    for column in FACET_COLUMNS:
        if column.name in _LARGEST:
            values = np.nan_to_num(rows[column.name], nan=0.0, posinf=np.inf, neginf=-np.inf)
            bounded(column.name, values, _LARGEST[column.name])
        if column.flags is not None and not np.isin(rows[column.name], list(column.flags)).all():
            raise ValueError(f"{column.name} holds a value without a meaning")


def _check_final_stages(result: CaseResult) -> None:
    """Durations are part of the flight: those that are allowed, and those of the flights."""
    case, free = result.case, result.case.free_final_stage
    if free is None:
        return
    for name, value in vars(free).items():
        if value is not None:
            positive(name, value, _LARGEST["final_stage_s"])
    if not free.shortest_s < free.longest_s < case.tof_s or (free.compared_s or 0.0) >= case.tof_s:
        raise ValueError("the final stage's durations do not ascend, or exceed tof_s")
    rows = result.solutions.rows
    durations = rows["final_stage_s"][rows["verdict"] == Verdict.REACHABLE]
    if not ((durations > 0.0) & (durations < case.tof_s)).all():
        raise ValueError("a final_stage_s is not within tof_s")


def _check_boundary(boundary: Group, facets: int) -> None:
    """Lists of facets, or one number a facet."""
    for name, member in boundary.members.items():
        if not isinstance(member, Dataset) or member.data.ndim != 1:
            raise ValueError(f"boundary/{name} is no list")
        if name == "domain" and len(member.data) != facets:
            raise ValueError("the domain does not tell of every facet")
        if member.data.dtype.kind in "iu":
            _all_within(f"boundary/{name}", member.data, facets)
    names = boundary.members.keys()
    if names & _SECTION_LISTS and names != _SECTION_LISTS | {"domain"}:
        raise ValueError("boundary lacks a list of the section, or holds another")


def _check_trace(result: CaseResult, boundary: Group) -> None:
    """Loops that exist, edges between vertices that exist, and the counts that go with them."""
    if not isinstance(result.summary.get("trace"), Mapping):
        raise ValueError("summary/trace is missing")
    boundary.dataset("domain")
    along = ("loop", "reachable_facet", "unreachable_facet", "start_vertex", "end_vertex")
    edges = {len(boundary.dataset(name).data) for name in along}
    if len(edges) != 1:
        raise ValueError("the lists of the boundary's edges differ in length")
    _all_within("boundary/loop", boundary.dataset("loop").data, len(boundary.dataset("loop_closed").data))
    for name in ("start_vertex", "end_vertex"):
        _all_within(f"boundary/{name}", boundary.dataset(name).data, len(result.case.asteroid.mesh.vertices))
    _all_within(
        "boundary/seed_facets", boundary.dataset("seed_facets").data, len(result.case.asteroid.mesh.faces)
    )


def check_summary(stored: Mapping[str, Any], known: Mapping[str, Any], path: str = "summary") -> None:
    """Hold a summary to the numbers that are printed of it, or raise ValueError."""
    for name, value in known.items():
        if name not in stored:
            raise ValueError(f"{path} lacks {name}")
        found = stored[name]
        if isinstance(value, Mapping):
            if not isinstance(found, Mapping):
                raise ValueError(f"{path}/{name} is no group")
            check_summary(found, value, f"{path}/{name}")
        elif not (found is None or isinstance(found, int | float)):
            raise ValueError(f"{path}/{name} is no number")


def check_printable(path: str, values: Mapping[str, Any]) -> None:
    """Hold a summary to numbers, words and groups of them, or raise ValueError."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            check_printable(f"{path}/{name}", value)
        elif not (value is None or isinstance(value, int | float | str)):
            raise ValueError(f"{path}/{name} is neither number nor word")


def _all_within(name: str, indices: NDArray[Any], count: int) -> None:
    if indices.dtype.kind not in "iu" or (indices.size and not 0 <= indices.min() <= indices.max() < count):
        raise ValueError(f"{name} names what does not exist")

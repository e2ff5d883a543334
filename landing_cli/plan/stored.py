"""A plan run as a tree on disk, and one plan as a journal record."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.bvh import SurfaceIndex, build_surface_index
from landing_cli.body.gravity.field import GravityField
from landing_cli.body.landing_site import Site
from landing_cli.errors import InputRefused
from landing_cli.flight.legs import AccelerationLeg
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.flight.trajectory import Trajectory
from landing_cli.plan.records import Plan, PlanCase, PlanStatus
from landing_cli.plan.sampled_flight import sampled_flight
from landing_cli.plan.stored_legs import (
    LEG_DATA,
    kind_of,
    leg_datasets,
    leg_from_group,
    leg_to_group,
    make_leg,
)
from landing_cli.results.body_checks import check_spacecraft
from landing_cli.results.body_group import body_from_group, body_to_group, number, vector
from landing_cli.results.store import StoredResult
from landing_cli.results.tree import Dataset, Group

FloatArray = NDArray[np.float64]
Arrays = dict[str, NDArray[Any]]

MISSION = "plan"
CPU_ATTRIBUTE = "plan_cpu_s"  # in /provenance: it differs from run to run

_CASE_NUMBERS = ("tof_s", "clearance_m", "cone_half_angle_rad")
_CASE_VECTORS = (
    "position_m",
    "velocity_m_s",
    "acceleration_m_s2",
    "landing_velocity_m_s",
    "landing_acceleration_m_s2",
)
_CASE_CHOICES = ("clearance_metric", "mass_model")
_PLAN_NUMBERS = (
    "tof_s",
    "fuel_kg",
    "delta_v_m_s",
    "peak_thrust_n",
    "clearance_surface_m",
    "clearance_vertices_m",
    "landing_angle_deg",
    "cone_entry_s",
)
_COLUMNS = (
    ("t_s", "s", "time since the initial state"),
    ("position_m", "m", "position, body frame"),
    ("velocity_m_s", "m s-1", "velocity relative to the rotating body frame"),
    ("mass_kg", "kg", "mass that the thrust acts on"),
    ("thrust_n", "N", "thrust, rotating body frame"),
)


@dataclass(frozen=True, eq=False)
class PlanEntry:
    """One plan of a run.

    Attributes
    ----------
    name : str
        ``<method>_<time of flight>s``.
    case : PlanCase
        What was asked; its time of flight is that of the plan.
    plan : Plan
    cpu_s : float
        NaN where unknown.
    """

    name: str
    case: PlanCase
    plan: Plan
    cpu_s: float

    @property
    def trajectory(self) -> Trajectory | None:
        """The path: as stored, or evaluated from the control."""
        if self.plan.trajectory is None and self.plan.control:
            return sampled_flight(self.case, self.plan.control)[0]
        return self.plan.trajectory


@dataclass(frozen=True, eq=False)
class PlanRun:
    """A plan run: plans of one spacecraft over one asteroid.

    Attributes
    ----------
    cases : tuple of PlanEntry
        At least one, in the order they were asked for.
    """

    cases: tuple[PlanEntry, ...]

    @property
    def asteroid(self) -> Asteroid:
        """The asteroid that all plans share."""
        return self.cases[0].case.asteroid

    @property
    def spacecraft(self) -> Spacecraft:
        """The spacecraft that all plans share."""
        return self.cases[0].case.spacecraft


def plan_to_arrays(plan: Plan, cpu_s: float, with_trajectory: bool) -> Arrays:
    """Encode a plan for the journal.

    Parameters
    ----------
    plan : Plan
        What was found.
    cpu_s : float
        What it took.
    with_trajectory : bool
        Whether to keep the samples; the control suffices to make them again.

    Returns
    -------
    dict of arrays
    """
    facts = {**_facts(plan), "cpu_s": cpu_s, "legs": [kind_of(leg) for leg in plan.control]}
    arrays: Arrays = {"facts": np.frombuffer(json.dumps(facts).encode(), dtype=np.uint8)}
    for index, leg in enumerate(plan.control):
        arrays |= {f"leg{index}_{name}": value for name, (value, *_) in leg_datasets(leg).items()}
    if with_trajectory and plan.trajectory is not None:
        arrays |= {f"path_{name}": getattr(plan.trajectory, name) for name, *_ in _COLUMNS}
    return arrays


def plan_from_arrays(arrays: Mapping[str, NDArray[Any]], gravity: GravityField) -> tuple[Plan, float]:
    """Decode what ``plan_to_arrays`` encoded.

    Parameters
    ----------
    arrays : mapping of arrays
        A journal record.
    gravity : GravityField
        The field that the plan flies in.

    Returns
    -------
    Plan
    float
        CPU seconds.

    Raises
    ------
    InputRefused
        If it is not of this version's types and shapes.
    """
    try:
        facts = json.loads(np.asarray(arrays["facts"], dtype=np.uint8).tobytes())
        control = tuple(
            make_leg(kind, {name: arrays.get(f"leg{i}_{name}") for name in LEG_DATA[kind]}, gravity)
            for i, kind in enumerate(facts["legs"])
        )
        path = {name: arrays[f"path_{name}"] for name, *_ in _COLUMNS} if "path_t_s" in arrays else None
        return _plan(facts, control, path), float(facts["cpu_s"])
    except (KeyError, ValueError, TypeError) as error:
        raise _unfit(f"a journal record is not of this version: {error}") from error


def run_to_tree(run: PlanRun) -> Group:
    """Lay a run out for the store.

    Parameters
    ----------
    run : PlanRun
        With at least one plan.

    Returns
    -------
    Group
        With the groups ``body``, ``spacecraft`` and ``cases``.
    """
    craft = {name: value for name, value in vars(run.spacecraft).items() if value is not None}
    cases = {entry.name: _entry_to_group(entry, order) for order, entry in enumerate(run.cases)}
    members = {"body": body_to_group(run.asteroid), "spacecraft": Group({}, craft), "cases": Group(cases)}
    return Group(members, {"mission": MISSION})


def run_from_result(result: StoredResult) -> PlanRun:
    """Rebuild a run from its file.

    Parameters
    ----------
    result : StoredResult
        As it was read.

    Returns
    -------
    PlanRun
        Equal to the run that was stored.

    Raises
    ------
    InputRefused
        If the file is of another mission, or lacks a part.
    """
    if result.mission != MISSION:
        told = f"holds a result of '{result.mission}', not of '{MISSION}'"
        raise InputRefused(told, where=str(result.path), fix="name a file that `plan` wrote")
    try:
        return _run_from_tree(result.tree, result.provenance.get(CPU_ATTRIBUTE))
    except (KeyError, ValueError, TypeError, IndexError, OverflowError) as error:
        raise _unfit(f"lacks a part or holds a wrong one: {error}", str(result.path)) from error


def _run_from_tree(tree: Group, cpu: Any) -> PlanRun:
    asteroid = body_from_group(tree.group("body"))
    craft = Spacecraft(**tree.group("spacecraft").attributes)  # type: ignore[arg-type]
    check_spacecraft(craft)
    surface = build_surface_index(asteroid.mesh)
    groups = {name: tree.group("cases", name) for name in tree.group("cases").members}
    ordered = sorted(groups, key=lambda name: number(groups[name], "order"))
    times = np.ravel(np.asarray(cpu, dtype=np.float64)) if cpu is not None else np.zeros(0)
    if not ordered:
        raise ValueError("no plan")
    return PlanRun(
        tuple(
            _entry_from_group(
                name, groups[name], asteroid, craft, surface, times[i] if i < len(times) else np.nan
            )
            for i, name in enumerate(ordered)
        )
    )


def _entry_to_group(entry: PlanEntry, order: int) -> Group:
    case, plan = entry.case, entry.plan
    asked: dict[str, Any] = {
        name: getattr(case, name) for name in (*_CASE_NUMBERS, *_CASE_VECTORS, *_CASE_CHOICES)
    }
    asked |= {
        "name": case.name,
        "site_position_m": case.site.position_m,
        "site_normal": case.site.normal,
        "site_facet": case.site.facet,
    }
    found: dict[str, Any] = {name: getattr(plan, name) for name in _PLAN_NUMBERS}
    found |= {name: getattr(plan, name) for name in ("method", "status", "message", "iterations")}
    found["parameters"] = json.dumps(plan.parameters)
    members: dict[str, Dataset | Group] = {"asked": Group({}, asked), "found": Group({}, found)}
    if plan.control:
        legs = {f"{index}": leg_to_group(leg) for index, leg in enumerate(plan.control)}
        members["control"] = Group(legs)
    if plan.trajectory is not None:
        members["trajectory"] = _trajectory_to_group(plan.trajectory)
    return Group(members, {"order": order})


def _trajectory_to_group(path: Trajectory) -> Group:
    members = {}
    for name, units, told in _COLUMNS:
        data = getattr(path, name)
        members[name] = Dataset(data, units, told, ("sample", "xyz")[: data.ndim])
    return Group(members)


def _entry_from_group(
    name: str, group: Group, asteroid: Asteroid, craft: Spacecraft, surface: SurfaceIndex, cpu_s: float
) -> PlanEntry:
    asked, found = group.group("asked"), group.group("found")
    facts: dict[str, Any] = {key: number(asked, key) for key in _CASE_NUMBERS}
    facts |= {key: vector(asked, key) for key in _CASE_VECTORS}
    facts |= {key: str(asked.attributes[key]) for key in _CASE_CHOICES}
    site = Site(
        vector(asked, "site_position_m"), vector(asked, "site_normal"), int(number(asked, "site_facet"))
    )
    case = PlanCase(
        name=str(asked.attributes["name"]),
        asteroid=asteroid,
        spacecraft=craft,
        site=site,
        surface=surface,
        **facts,
    )
    control: tuple[AccelerationLeg, ...] = ()
    if "control" in group.members:
        legs = group.group("control")
        control = tuple(
            leg_from_group(legs.group(str(i)), asteroid.gravity) for i in range(len(legs.members))
        )
    path = None
    if "trajectory" in group.members:
        stored = group.group("trajectory")
        path = {column: stored.dataset(column).data for column, *_ in _COLUMNS}
    told: dict[str, Any] = {key: number(found, key) for key in (*_PLAN_NUMBERS, "iterations")}
    told |= {key: str(found.attributes[key]) for key in ("method", "status", "message")}
    told["parameters"] = json.loads(str(found.attributes["parameters"]))
    told["clearance_metric"] = case.clearance_metric
    return PlanEntry(name, case, _plan(told, control, path), float(cpu_s))


def _facts(plan: Plan) -> dict[str, Any]:
    names = (*_PLAN_NUMBERS, "method", "status", "message", "iterations", "clearance_metric", "parameters")
    return {name: getattr(plan, name) for name in names}


def _plan(
    facts: Mapping[str, Any],
    control: tuple[AccelerationLeg, ...],
    path: Mapping[str, NDArray[Any]] | None,
) -> Plan:
    if facts["status"] not in get_args(PlanStatus):
        raise ValueError(f"no status {facts['status']}")
    numbers: dict[str, Any] = {name: float(facts[name]) for name in _PLAN_NUMBERS}
    words: dict[str, Any] = {
        name: facts[name] for name in ("method", "status", "message", "clearance_metric", "parameters")
    }
    trajectory = None if path is None else _trajectory(path)
    return Plan(
        trajectory=trajectory, control=control, iterations=int(facts["iterations"]), **numbers, **words
    )


def _trajectory(path: Mapping[str, NDArray[Any]]) -> Trajectory:
    n = len(path["t_s"])
    for name, *_ in _COLUMNS:
        shape = (n,) if name in ("t_s", "mass_kg") else (n, 3)
        if path[name].shape != shape or path[name].dtype != np.float64:
            raise ValueError(f"the trajectory's {name} is {path[name].dtype} {path[name].shape}")
    return Trajectory(**path)


def _unfit(what: str, where: str = "") -> InputRefused:
    return InputRefused(what, where=where, fix="run again with --force, or use the version that wrote it")

"""An observation run as a tree on disk, and one observation as a journal record."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.errors import InputRefused
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.observe.observed import Clustering, Observation, ObservedPath
from landing_cli.observe.records import Objective, ObserveCase
from landing_cli.observe.stored_case import case_from_group, case_to_group
from landing_cli.observe.stored_clusters import clustering_from_group, clustering_to_group
from landing_cli.observe.stored_paths import (
    WAYPOINTS,
    Arrays,
    make_observed,
    make_waypoints,
    observed_arrays,
    observed_facts,
    observed_from_group,
    observed_to_members,
)
from landing_cli.results.body_checks import check_spacecraft
from landing_cli.results.body_group import body_from_group, body_to_group, number
from landing_cli.results.store import StoredResult
from landing_cli.results.tree import Dataset, Group

MISSION = "observe"
CPU_ATTRIBUTE = "observation_cpu_s"  # in /provenance: it differs from run to run


@dataclass(frozen=True, eq=False)
class ObservationEntry:
    """One observation of a run.

    Attributes
    ----------
    name : str
        ``waypoints_<m>`` or ``information_<weight>``.
    case : ObserveCase
        What was asked; all entries of a run share it.
    observation : Observation
        Its nominal path and clusters are those of the run.
    cpu_s : float
        NaN where unknown.
    """

    name: str
    case: ObserveCase
    observation: Observation
    cpu_s: float


@dataclass(frozen=True, eq=False)
class ObserveRun:
    """An observation run: one landing, steered in several ways.

    Attributes
    ----------
    cases : tuple of ObservationEntry
        At least one, in the order they were asked for.
    """

    cases: tuple[ObservationEntry, ...]

    @property
    def asteroid(self) -> Asteroid:
        """The asteroid."""
        return self.cases[0].case.asteroid

    @property
    def spacecraft(self) -> Spacecraft:
        """The spacecraft."""
        return self.cases[0].case.spacecraft


def observation_to_arrays(observation: Observation, cpu_s: float) -> Arrays:
    """Encode an observation for the journal, without what the whole run shares.

    Parameters
    ----------
    observation : Observation
        What was found.
    cpu_s : float
        What it took.

    Returns
    -------
    dict of arrays
    """
    facts = {**observed_facts(observation.steered), "objective": observation.objective, "cpu_s": cpu_s}
    facts["parameters"] = dict(observation.parameters)
    arrays = observed_arrays(observation.steered)
    if observation.waypoints is not None:
        facts["timing"] = observation.waypoints.timing
        arrays |= {f"waypoints_{name}": getattr(observation.waypoints, name) for name, *_ in WAYPOINTS}
    return {**arrays, "facts": np.frombuffer(json.dumps(facts).encode(), dtype=np.uint8)}


def observation_from_arrays(
    arrays: Mapping[str, NDArray[Any]], nominal: ObservedPath, clustering: Clustering
) -> tuple[Observation, float]:
    """Decode what ``observation_to_arrays`` encoded.

    Parameters
    ----------
    arrays : mapping of arrays
        A journal record.
    nominal : ObservedPath
        Of the run.
    clustering : Clustering
        Of the run.

    Returns
    -------
    Observation
    float
        CPU seconds.

    Raises
    ------
    InputRefused
        If it is not of this version's types and shapes.
    """
    try:
        facts = json.loads(np.asarray(arrays["facts"], dtype=np.uint8).tobytes())
        waypoints = None
        if "timing" in facts:
            columns = {name: arrays[f"waypoints_{name}"] for name, *_ in WAYPOINTS}
            waypoints = make_waypoints(columns, facts["timing"])
        observation = Observation(
            objective=_objective(facts["objective"]),
            nominal=nominal,
            clustering=clustering,
            waypoints=waypoints,
            steered=make_observed(arrays, facts),
            parameters=facts["parameters"],
        )
        return observation, float(facts["cpu_s"])
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        raise _unfit(f"a journal record is not of this version: {error}") from error


def run_to_tree(run: ObserveRun) -> Group:
    """Lay a run out for the store.

    Parameters
    ----------
    run : ObserveRun
        With at least one observation.

    Returns
    -------
    Group
        With the groups ``body``, ``spacecraft``, ``asked``, ``nominal``, ``clusters`` and ``cases``.
    """
    first = run.cases[0]
    craft = {name: value for name, value in vars(run.spacecraft).items() if value is not None}
    nominal = first.observation.nominal
    members: dict[str, Dataset | Group] = {
        "body": body_to_group(run.asteroid),
        "spacecraft": Group({}, craft),
        "asked": case_to_group(first.case),
        "nominal": Group(observed_to_members(nominal), observed_facts(nominal)),
        "clusters": clustering_to_group(first.observation.clustering),
        "cases": Group({entry.name: _entry_to_group(entry, order) for order, entry in enumerate(run.cases)}),
    }
    return Group(members, {"mission": MISSION})


def run_from_result(result: StoredResult) -> ObserveRun:
    """Rebuild a run from its file.

    Parameters
    ----------
    result : StoredResult
        As it was read.

    Returns
    -------
    ObserveRun
        Equal to the run that was stored.

    Raises
    ------
    InputRefused
        If the file is of another mission, or lacks a part.
    """
    if result.mission != MISSION:
        told = f"holds a result of '{result.mission}', not of '{MISSION}'"
        raise InputRefused(told, where=str(result.path), fix="name a file that `plan observe` wrote")
    try:
        return _run_from_tree(result.tree, result.provenance.get(CPU_ATTRIBUTE))
    except (KeyError, ValueError, TypeError, IndexError, OverflowError, AttributeError) as error:
        raise _unfit(f"lacks a part or holds a wrong one: {error}", str(result.path)) from error


def _run_from_tree(tree: Group, cpu: Any) -> ObserveRun:
    asteroid = body_from_group(tree.group("body"))
    craft = Spacecraft(**tree.group("spacecraft").attributes)  # type: ignore[arg-type]
    check_spacecraft(craft)
    case = case_from_group(tree.group("asked"), asteroid, craft)
    nominal = observed_from_group(tree.group("nominal"))
    count = len(case.landmarks.position_m)
    clustering = clustering_from_group(tree.group("clusters"), count)
    groups = {name: tree.group("cases", name) for name in tree.group("cases").members}
    ordered = sorted(groups, key=lambda name: number(groups[name], "order"))
    if not ordered:
        raise ValueError("no observation")
    times = np.ravel(np.asarray(cpu, dtype=np.float64)) if cpu is not None else np.zeros(0)
    entries = []
    for i, name in enumerate(ordered):
        observation = _observation_from_group(groups[name], nominal, clustering)
        for observed in (nominal, observation.steered):
            if observed.seen.visible.shape[1] != count:
                raise ValueError("the landmarks in view are not those that were asked")
        cpu_s = float(times[i]) if i < len(times) else float("nan")
        entries.append(ObservationEntry(name, case, observation, cpu_s))
    return ObserveRun(tuple(entries))


def _entry_to_group(entry: ObservationEntry, order: int) -> Group:
    observation = entry.observation
    facts: dict[str, Any] = {**observed_facts(observation.steered), "objective": observation.objective}
    facts |= {"order": order, "parameters": json.dumps(dict(observation.parameters))}
    members = observed_to_members(observation.steered)
    waypoints = observation.waypoints
    if waypoints is not None:
        members["waypoints"] = Group(
            {name: Dataset(getattr(waypoints, name), *told) for name, *told in WAYPOINTS},  # type: ignore[arg-type]
            {"timing": waypoints.timing},
        )
    return Group(members, facts)


def _observation_from_group(group: Group, nominal: ObservedPath, clustering: Clustering) -> Observation:
    waypoints = None
    if "waypoints" in group.members:
        stored = group.group("waypoints")
        columns = {name: stored.dataset(name).data for name, *_ in WAYPOINTS}
        waypoints = make_waypoints(columns, stored.attributes["timing"])
    parameters = json.loads(str(group.attributes["parameters"]))
    if not isinstance(parameters, dict):
        raise ValueError("the parameters are no mapping")
    return Observation(
        objective=_objective(group.attributes["objective"]),
        nominal=nominal,
        clustering=clustering,
        waypoints=waypoints,
        steered=observed_from_group(group),
        parameters=parameters,
    )


def _objective(value: Any) -> Objective:
    if value not in get_args(Objective):
        raise ValueError(f"no objective {value}")
    objective: Objective = value
    return objective


def _unfit(what: str, where: str = "") -> InputRefused:
    return InputRefused(what, where=where, fix="run again with --force, or use the version that wrote it")

"""Tours in memory and in the file: the same numbers in both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.flight.elements import OrbitElements
from landing_cli.results.body_group import number, vector
from landing_cli.results.columns import Column
from landing_cli.results.store import StoredResult
from landing_cli.results.tree import Dataset, Group, table_group, table_rows
from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.tour.escape_records import EscapeRun
from landing_cli.tour.records import Departure, FlybyChain, Leg, SearchLimits, SearchMethod
from landing_cli.tour.run_records import (
    ChainEntry,
    ChainPath,
    PrintedDay,
    RunKind,
    SchemeModel,
    TourFacts,
    TourRun,
)
from landing_cli.tour.stored_chains import (
    DAY_COLUMNS,
    DEPTH_COLUMNS,
    MODEL_COLUMNS,
    PATH_COLUMNS,
    chain_from_group,
    chain_to_group,
    depths_of,
    table_of,
    unfit,
)
from landing_cli.tour.stored_escape import escape_from_tree, escape_to_members
from landing_cli.tour.stored_words import choice, text

MISSION = "tour"

_ELEMENT_COLUMNS = (
    Column("epoch_t_s", "f8", "s", "epoch of the elements, TDB past J2000"),
    Column("a_m", "f8", "m", "semi-major axis"),
    Column("e", "f8", "1", "eccentricity"),
    Column("inclination_rad", "f8", "rad", "inclination, ecliptic and equinox J2000"),
    Column("node_rad", "f8", "rad", "longitude of the ascending node"),
    Column("argument_rad", "f8", "rad", "argument of perihelion"),
    Column("mean_anomaly_rad", "f8", "rad", "mean anomaly at the epoch"),
)
_TARGET_COLUMNS = (
    *_ELEMENT_COLUMNS,
    Column("absolute_magnitude", "f8", "1", "H"),
    Column("condition_code", "i8", "1", "uncertainty U of the orbit, -1 where unknown"),
    Column("numbered", "i8", "1", "1 for an orbit with a permanent number"),
)
_DEPARTURE = ("t_s", "geocentric_distance_m", "angle_rad", "radial_speed_m_s")
_DEPARTURE_ALL = (*_DEPARTURE, "position_m", "velocity_m_s")
_LIMITS = tuple(SearchLimits.__annotations__)
_WHOLE_LIMITS = ("asteroids_max", "revolutions_max")
_COUNTS = ("catalogue_rows", "catalogue_bad_rows", "searched_targets")


def run_to_tree(run: TourRun | EscapeRun) -> Group:
    """Lay a run out for the store.

    Parameters
    ----------
    run : TourRun or EscapeRun
        What was found.

    Returns
    -------
    Group
    """
    if isinstance(run, EscapeRun):
        return Group(escape_to_members(run), {"mission": MISSION, "kind": "escape"})
    facts = run.facts
    members: dict[str, Dataset | Group] = {
        "departure": Group({}, {name: getattr(facts.departure, name) for name in _DEPARTURE_ALL}),
        "limits": Group({}, {name: getattr(facts.limits, name) for name in _LIMITS}),
        "targets": _targets_to_group(facts.targets),
        "depths": table_group(table_of(run.depths, DEPTH_COLUMNS), DEPTH_COLUMNS, "depth"),
        "cases": Group({e.name: _entry_to_group(e, order) for order, e in enumerate(run.cases)}),
    }
    members["broken"] = Group({f"{i:04d}": chain_to_group(chain) for i, chain in enumerate(run.broken)})
    if run.days:
        members["days"] = _days_to_group(run.days)
    if run.nearest is not None:
        members["nearest"] = chain_to_group(run.nearest)
    attributes = {name: getattr(facts, name) for name in ("name", "kind", "method", "albedo", "ephemeris")}
    attributes |= {name: getattr(facts, name) for name in _COUNTS}
    return Group(members, {"mission": MISSION, **attributes})


def run_from_result(result: StoredResult) -> TourRun | EscapeRun:
    """Rebuild a run from its file.

    Parameters
    ----------
    result : StoredResult
        As it was read.

    Returns
    -------
    TourRun or EscapeRun
        Equal to the run that was stored.

    Raises
    ------
    InputRefused
        If the file is of another mission, or lacks a part.
    """
    if result.mission != MISSION:
        told = f"holds a result of '{result.mission}', not of '{MISSION}'"
        raise InputRefused(told, where=str(result.path), fix="name a file that `tour` wrote")
    try:
        if result.tree.attributes["kind"] == "escape":
            return escape_from_tree(result.tree)
        return _run_from_tree(result.tree)
    except (KeyError, ValueError, TypeError, IndexError, OverflowError) as error:
        raise unfit(f"lacks a part or holds a wrong one: {error}", str(result.path)) from error


def _run_from_tree(tree: Group) -> TourRun:
    departure, limits = tree.group("departure"), tree.group("limits")
    bounds: dict[str, Any] = {name: number(limits, name) for name in _LIMITS}
    bounds |= {name: int(bounds[name]) for name in _WHOLE_LIMITS}
    facts = TourFacts(
        name=text(tree, "name"),
        kind=choice(text(tree, "kind"), get_args(RunKind)),
        method=choice(text(tree, "method"), get_args(SearchMethod)),
        departure=Departure(
            position_m=vector(departure, "position_m"),
            velocity_m_s=vector(departure, "velocity_m_s"),
            **{name: number(departure, name) for name in _DEPARTURE},
        ),
        limits=SearchLimits(**bounds),
        albedo=number(tree, "albedo"),
        ephemeris=text(tree, "ephemeris"),
        targets=_targets_from_group(tree.group("targets")),
        **{name: int(number(tree, name)) for name in _COUNTS},
    )
    groups = _groups(tree.group("cases"))
    ordered = sorted(groups, key=lambda name: number(groups[name], "order"))
    return TourRun(
        tuple(_entry_from_group(name, groups[name], facts) for name in ordered),
        facts,
        depths_of(table_rows(tree.group("depths"), DEPTH_COLUMNS)),
        chain_from_group(tree.group("nearest")) if "nearest" in tree.members else None,
        tuple(chain_from_group(group) for _, group in sorted(_groups(tree.group("broken")).items())),
        _days_from_group(tree.group("days")) if "days" in tree.members else (),
    )


def _groups(group: Group) -> dict[str, Group]:
    return {name: group.group(name) for name in group.members}


def _entry_to_group(entry: ChainEntry, order: int) -> Group:
    group = chain_to_group(entry.chain)
    members = dict(group.members)
    if entry.path is not None:
        columns = {column.name: getattr(entry.path, column.name) for column in PATH_COLUMNS}
        members["trajectory"] = table_group(columns, PATH_COLUMNS, "sample")
    if entry.model is not None:
        columns = {column.name: getattr(entry.model, column.name) for column in MODEL_COLUMNS}
        members["model"] = table_group(columns, MODEL_COLUMNS, "flyby")
    return Group(members, {**group.attributes, "order": order})


def _entry_from_group(name: str, group: Group, facts: TourFacts) -> ChainEntry:
    chain, path = chain_from_group(group), None
    if any(not 0 <= leg.target < len(facts.targets) for leg in chain.legs):
        raise ValueError(f"{name} passes an asteroid that is not in the list of targets")
    if "trajectory" in group.members:
        rows = table_rows(group.group("trajectory"), PATH_COLUMNS)
        if not len(rows):
            raise ValueError(f"the trajectory of {name} is empty")
        path = ChainPath(**{column.name: np.ascontiguousarray(rows[column.name]) for column in PATH_COLUMNS})
    model = None
    if "model" in group.members:
        burns = table_rows(group.group("model"), MODEL_COLUMNS)
        if len(burns) != len(chain.legs):
            raise ValueError(f"the model of {name} has {len(burns)} burns")
        model = SchemeModel(**{c.name: np.ascontiguousarray(burns[c.name]) for c in MODEL_COLUMNS})
    return ChainEntry(name, chain, path, facts, model)


def _days_to_group(days: Sequence[PrintedDay]) -> Group:
    table = table_group(table_of(days, DAY_COLUMNS), DAY_COLUMNS, "printed_flyby")
    names = Dataset(np.array([day.designation for day in days]), "1", "designation", ("printed_flyby",))
    return Group({**table.members, "designation": names})


def _days_from_group(group: Group) -> tuple[PrintedDay, ...]:
    rows, names = table_rows(group, DAY_COLUMNS), group.dataset("designation").data.tolist()
    return tuple(
        PrintedDay(int(row["scheme"]), str(name), float(row["least_m"]), float(row["greatest_m"]))
        for row, name in zip(rows, names, strict=True)
    )


def _targets_to_group(targets: Catalogue) -> Group:
    columns: dict[str, NDArray[Any]] = {c.name: getattr(targets.elements, c.name) for c in _ELEMENT_COLUMNS}
    columns |= {
        "absolute_magnitude": targets.absolute_magnitude,
        "condition_code": targets.condition_code.astype(np.int64),
        "numbered": targets.numbered.astype(np.int64),
    }
    table = table_group(columns, _TARGET_COLUMNS, "target")
    names = Dataset(np.array(targets.designations, dtype="U"), "1", "designation", ("target",))
    attributes = {"source": targets.source, "sha256": targets.sha256}
    return Group({**table.members, "designation": names}, attributes)


def _targets_from_group(group: Group) -> Catalogue:
    rows = table_rows(group, _TARGET_COLUMNS)
    names = tuple(map(str, group.dataset("designation").data.tolist()))
    if len(names) != len(rows):
        raise ValueError(f"{len(names)} designations of {len(rows)} targets")
    elements = OrbitElements(**{c.name: np.ascontiguousarray(rows[c.name]) for c in _ELEMENT_COLUMNS})
    return Catalogue(
        names,
        elements,
        np.ascontiguousarray(rows["absolute_magnitude"]),
        np.ascontiguousarray(rows["condition_code"]),
        rows["numbered"] != 0,
        text(group, "source"),
        text(group, "sha256"),
        (),
    )


def used_targets(chains: Sequence[FlybyChain], catalogue: Catalogue) -> tuple[Catalogue, list[FlybyChain]]:
    """Keep the asteroids that chains pass, and count their rows anew.

    Parameters
    ----------
    chains : sequence of FlybyChain
        Their legs count the rows of `catalogue`.
    catalogue : Catalogue
        All targets.

    Returns
    -------
    Catalogue
        In the order of the full one.
    list of FlybyChain
        Their legs count its rows.
    """
    used = sorted({leg.target for chain in chains for leg in chain.legs})
    row = {target: index for index, target in enumerate(used)}

    def renumbered(legs: tuple[Leg, ...]) -> tuple[Leg, ...]:
        return tuple(replace(leg, target=row[leg.target]) for leg in legs)

    again = [
        replace(
            chain,
            legs=renumbered(chain.legs),
            nbody_legs=None if chain.nbody_legs is None else renumbered(chain.nbody_legs),
        )
        for chain in chains
    ]
    return catalogue.take(np.array(used, dtype=np.int64)), again

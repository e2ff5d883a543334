"""Tours in memory, in the journal and in the file: the same numbers in each."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
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
from landing_cli.tour.records import (
    ChainStatus,
    Departure,
    DepthReport,
    Flyby,
    FlybyChain,
    Leg,
    SearchLimits,
    SearchMethod,
)
from landing_cli.tour.run_records import ChainEntry, ChainPath, RunKind, TourFacts, TourRun
from landing_cli.tour.stored_escape import escape_from_tree, escape_to_members
from landing_cli.tour.stored_words import choice, text

MISSION = "tour"

Arrays = dict[str, NDArray[Any]]

LEG_COLUMNS = (
    Column("target", "i8", "1", "row of /targets"),
    Column("burn_t_s", "f8", "s", "time of the burn, TDB past J2000"),
    Column("arrival_t_s", "f8", "s", "time of the flyby, TDB past J2000"),
    Column("delta_v_m_s", "f8", "m s-1", "the burn, heliocentric axes, ecliptic and equinox J2000", (3,)),
    Column("revolutions", "i8", "1", "whole revolutions about the Sun on the way"),
)
FLYBY_COLUMNS = (
    Column("t_s", "f8", "s", "time of the flyby, TDB past J2000"),
    Column("position_m", "f8", "m", "the asteroid, heliocentric, ecliptic and equinox J2000", (3,)),
    Column("relative_velocity_m_s", "f8", "m s-1", "of the spacecraft relative to the asteroid", (3,)),
    Column("phase_angle_rad", "f8", "rad", "Sun - asteroid - spacecraft on approach"),
    Column("geocentric_distance_m", "f8", "m", "asteroid to Earth"),
    Column("absolute_magnitude", "f8", "1", "H"),
    Column("diameter_m", "f8", "m", "of H and the assumed albedo"),
    Column("apparent_magnitude", "f8", "1", "seen from the Earth"),
    Column("miss_m", "f8", "m", "distance of spacecraft and asteroid that the flight leaves"),
)
PATH_COLUMNS = (
    Column("t_s", "f8", "s", "TDB past J2000"),
    Column("position_m", "f8", "m", "spacecraft, heliocentric, ecliptic and equinox J2000", (3,)),
    Column("velocity_m_s", "f8", "m s-1", "spacecraft, heliocentric, ecliptic and equinox J2000", (3,)),
    Column("arc", "i8", "1", "coast: 0 before the first burn, i after burn i"),
)
DEPTH_COLUMNS = (
    Column("asteroids", "i8", "1", "length of the chains"),
    Column("tried", "i8", "1", "transfers computed"),
    Column("within_limits", "i8", "1", "of them, those that keep to every limit"),
    Column("kept", "i8", "1", "chains from which the search went on"),
    Column("least_delta_v_m_s", "f8", "m s-1", "least two-body sum, beyond the limit too"),
)
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


def chain_to_arrays(chain: FlybyChain, path: ChainPath | None = None) -> Arrays:
    """Encode a chain for the journal.

    Parameters
    ----------
    chain : FlybyChain
        What was found.
    path : ChainPath, optional
        Its flight.

    Returns
    -------
    dict of arrays
    """
    facts = {
        "status": chain.status,
        "message": chain.message,
        "targets": chain.targets,
        "departure_t_s": chain.departure_t_s,
    }
    arrays: Arrays = {
        "facts": np.frombuffer(json.dumps(facts).encode(), dtype=np.uint8),
        "legs": _rows(chain.legs, LEG_COLUMNS),
        "flybys": _rows(chain.flybys, FLYBY_COLUMNS),
    }
    if chain.nbody_legs is not None:
        arrays["nbody_legs"] = _rows(chain.nbody_legs, LEG_COLUMNS)
    if path is not None:
        arrays |= {f"path_{column.name}": getattr(path, column.name) for column in PATH_COLUMNS}
    return arrays


def chain_from_arrays(arrays: Mapping[str, NDArray[Any]]) -> tuple[FlybyChain, ChainPath | None]:
    """Decode what `chain_to_arrays` encoded.

    Parameters
    ----------
    arrays : mapping of arrays
        A journal record.

    Returns
    -------
    FlybyChain
    ChainPath or None

    Raises
    ------
    InputRefused
        If it is not of this version's types and shapes.
    """
    try:
        facts = json.loads(np.asarray(arrays["facts"], dtype=np.uint8).tobytes())
        targets = tuple(map(str, facts["targets"]))
        chain = FlybyChain(
            float(facts["departure_t_s"]),
            _legs(arrays["legs"], targets),
            _legs(arrays["nbody_legs"], targets) if "nbody_legs" in arrays else None,
            _flybys(arrays["flybys"], targets),
            choice(facts["status"], get_args(ChainStatus)),
            str(facts["message"]),
        )
        names = [column.name for column in PATH_COLUMNS]
        path = {name: arrays[f"path_{name}"] for name in names} if "path_t_s" in arrays else None
        return chain, None if path is None else ChainPath(**path)
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise _unfit(f"a journal record is not of this version: {error}") from error


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
        "depths": table_group(_rows(run.depths, DEPTH_COLUMNS), DEPTH_COLUMNS, "depth"),
        "cases": Group({e.name: _entry_to_group(e, order) for order, e in enumerate(run.cases)}),
    }
    if run.nearest is not None:
        members["nearest"] = _chain_to_group(run.nearest)
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
        raise _unfit(f"lacks a part or holds a wrong one: {error}", str(result.path)) from error


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
    groups = {name: tree.group("cases", name) for name in tree.group("cases").members}
    ordered = sorted(groups, key=lambda name: number(groups[name], "order"))
    depths = table_rows(tree.group("depths"), DEPTH_COLUMNS)
    return TourRun(
        tuple(_entry_from_group(name, groups[name], facts) for name in ordered),
        facts,
        tuple(DepthReport(*row.item()) for row in depths),
        _chain_from_group(tree.group("nearest")) if "nearest" in tree.members else None,
    )


def _entry_to_group(entry: ChainEntry, order: int) -> Group:
    group = _chain_to_group(entry.chain)
    members = dict(group.members)
    if entry.path is not None:
        columns = {column.name: getattr(entry.path, column.name) for column in PATH_COLUMNS}
        members["trajectory"] = table_group(columns, PATH_COLUMNS, "sample")
    return Group(members, {**group.attributes, "order": order})


def _entry_from_group(name: str, group: Group, facts: TourFacts) -> ChainEntry:
    chain, path = _chain_from_group(group), None
    if any(not 0 <= leg.target < len(facts.targets) for leg in chain.legs):
        raise ValueError(f"{name} passes an asteroid that is not in the list of targets")
    if "trajectory" in group.members:
        rows = table_rows(group.group("trajectory"), PATH_COLUMNS)
        if not len(rows):
            raise ValueError(f"the trajectory of {name} is empty")
        path = ChainPath(**{column.name: np.ascontiguousarray(rows[column.name]) for column in PATH_COLUMNS})
    return ChainEntry(name, chain, path, facts)


def _chain_to_group(chain: FlybyChain) -> Group:
    members: dict[str, Dataset | Group] = {
        "legs": table_group(_rows(chain.legs, LEG_COLUMNS), LEG_COLUMNS, "flyby"),
        "flybys": table_group(_rows(chain.flybys, FLYBY_COLUMNS), FLYBY_COLUMNS, "flyby"),
    }
    if chain.nbody_legs is not None:
        members["nbody_legs"] = table_group(_rows(chain.nbody_legs, LEG_COLUMNS), LEG_COLUMNS, "flyby")
    attributes = {
        "targets": chain.targets,
        "status": chain.status,
        "message": chain.message,
        "departure_t_s": chain.departure_t_s,
        "delta_v_m_s": chain.delta_v_m_s,
        "nbody_delta_v_m_s": chain.nbody_delta_v_m_s,
    }
    return Group(members, attributes)


def _chain_from_group(group: Group) -> FlybyChain:
    names = group.attributes["targets"]
    if not isinstance(names, tuple):
        raise ValueError("a chain without targets")
    nbody = None
    if "nbody_legs" in group.members:
        nbody = _legs(table_rows(group.group("nbody_legs"), LEG_COLUMNS), names)
    return FlybyChain(
        number(group, "departure_t_s"),
        _legs(table_rows(group.group("legs"), LEG_COLUMNS), names),
        nbody,
        _flybys(table_rows(group.group("flybys"), FLYBY_COLUMNS), names),
        choice(text(group, "status"), get_args(ChainStatus)),
        text(group, "message"),
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


def _rows(records: Sequence[Any], columns: tuple[Column, ...]) -> NDArray[np.void]:
    rows = np.zeros(len(records), dtype=[(c.name, c.dtype, c.shape) for c in columns])
    for row, record in zip(rows, records, strict=True):
        for column in columns:
            row[column.name] = getattr(record, column.name)
    return rows


def _legs(rows: NDArray[Any], names: tuple[str, ...]) -> tuple[Leg, ...]:
    if not len(rows):
        raise ValueError("a chain without legs")
    return tuple(
        Leg(
            int(row["target"]),
            name,
            float(row["burn_t_s"]),
            float(row["arrival_t_s"]),
            np.array(row["delta_v_m_s"]),
            int(row["revolutions"]),
        )
        for row, name in zip(rows, names, strict=True)
    )


def _flybys(rows: NDArray[Any], names: tuple[str, ...]) -> tuple[Flyby, ...]:
    flybys = []
    for row, name in zip(rows, names, strict=bool(len(rows))):
        told: dict[str, Any] = {
            c.name: np.array(row[c.name]) if c.shape else float(row[c.name]) for c in FLYBY_COLUMNS
        }
        flybys.append(Flyby(designation=name, **told))
    return tuple(flybys)


def _unfit(what: str, where: str = "") -> InputRefused:
    return InputRefused(what, where=where, fix="run again with --force, or use the version that wrote it")

"""Whether a stored run does what it says: every control flown again, every limit checked on the flight.

The controls are flown open loop by an integrator that did not plan them, in the field they were planned in;
that integrator is checked against scipy's DOP853 on a few facets of each case and on its worst. The same
controls under the gravity of the mesh as a uniform polyhedron show the error of the gravity model; that fails
nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.flight.legs import FinalArcLeg
from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.reach.consistency import Fault, faults_of
from landing_cli.reach.flown import flown_trajectory, rows_with_flight
from landing_cli.reach.records import Verdict
from landing_cli.reach.reflight import (
    STORED,
    Ground,
    fly_rows,
    measure_rows,
    survey_ground,
)
from landing_cli.reach.stored import CaseResult
from landing_cli.reach.verify_margin import MARGIN_LIMITS, check_levels

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Told = Callable[[int], None]

CHUNK_ROWS, CHUNK_POLYHEDRON_ROWS = 128, 2
# Facets of each case that DOP853 flies too, and that fly under the polyhedron unless all do: a flight
# costs 0.06 s and 0.1 s.
DOP853_FACETS, POLYHEDRON_FACETS = 5, 20

# What a flight may miss, exceed or differ by at most.
LIMITS: Mapping[str, float] = {
    "touchdown_miss_m": 0.05,
    "touchdown_speed_m_s": 1e-3,
    "handover_miss_m": 0.05,
    "descent_thrust_excess": 2e-5,  # over the bound, relative
    "final_thrust_excess": 2e-5,
    "ellipsoid_depth": 2e-5,  # 1 - r'Re r along the descent
    "handover_off_ellipsoid": 2e-5,
    "glide_slope_excess_deg": 2e-3,
    "propellant_excess": 2e-5,  # over the bound, relative
    "depth_in_rock_m": 0.01,
    "integrators_apart_m": 1e-4,
    "integrators_apart_m_s": 1e-6,
}
# How far stored columns may be from the flown ones: relative to the value, or absolute.
RELATIVE: Mapping[str, float] = {
    "performance_index_m2_s3": 1e-5,
    "delta_v_m_s": 2e-4,  # integrated over 64 intervals of the final arc
    "fuel_kg": 2e-4,
    "handover_mass_kg": 1e-5,
}
ABSOLUTE: Mapping[str, float] = {
    "peak_thrust_ratio": 1e-5,
    "peak_thrust_ratio_descent": 1e-5,
    "peak_thrust_ratio_final": 1e-5,
    "ellipsoid_margin": 1e-4,  # the least of samples some seconds apart, and of parabolas through them
    "glide_slope_margin_deg": 2e-3,
}


@dataclass(frozen=True)
class Worst:
    """The worst of all facets in one respect.

    Attributes
    ----------
    value, limit : float
        Found, and allowed.
    facet : int
    failing : int
        Facets beyond the limit.
    """

    value: float
    limit: float
    facet: int
    failing: int


@dataclass(frozen=True)
class ModelError:
    """Misses of the same controls under the gravity of the mesh as a uniform polyhedron.

    Attributes
    ----------
    facets : int
        How many were flown.
    median_m, worst_m : float, m
    worst_facet : int
    """

    facets: int
    median_m: float
    worst_m: float
    worst_facet: int


@dataclass(frozen=True)
class CaseReport:
    """What the re-flight of a case found.

    Attributes
    ----------
    case : str
    facets, flown : int
        In the table, and flown again.
    worst : mapping of str to Worst
        By what was checked, causes before effects; ``stored_<column>`` compares a stored column with the
        flight.
    faults : tuple of Fault
        What cannot be true in the table.
    final_thrust_ratio : float
        Largest thrust over its bound that the final stages really fly, whichever reading is bounded.
    paths_through_rock : int
        Flown paths that cut the mesh.
    clearance_overstated_m : float
        Most that a stored terrain clearance, which is the least of samples, is above the flown path's.
    polyhedron : ModelError or None
        None where no facet is reachable, or the run flew under the polyhedron anyway.
    """

    case: str
    facets: int
    flown: int
    worst: Mapping[str, Worst]
    faults: tuple[Fault, ...]
    final_thrust_ratio: float
    paths_through_rock: int
    clearance_overstated_m: float
    polyhedron: ModelError | None

    @property
    def verified(self) -> bool:
        """Whether everything is as the result says."""
        return not self.faults and not any(worst.failing for worst in self.worst.values())

    @property
    def badness(self) -> float:
        """How far the worst check is beyond its limit, as a multiple of it; infinite for a fault."""
        return np.inf if self.faults else max((_badness(w) for w in self.worst.values()), default=0.0)

    @property
    def reason(self) -> str:
        """What is wrong, causes before effects, with the facet where it is worst; empty where nothing is."""
        if self.faults:
            more = f" (and {len(self.faults) - 1} more faults)" if len(self.faults) > 1 else ""
            return f"{self.case}: {self.faults[0].told}{more}"
        name = next((name for name, worst in self.worst.items() if worst.failing), None)
        if name is None:
            return ""
        worst = self.worst[name]
        told = (
            f"{self.case}: facet {worst.facet}: {name} {worst.value:.3g}, at most {worst.limit:g} is allowed"
        )
        return f"{told} ({worst.failing} of {self.flown} flown facets fail)"


def verify_run(
    results: tuple[CaseResult, ...],
    *,
    polyhedron_for_all: bool = False,
    jobs: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[CaseReport, ...]:
    """Fly every reachable facet of some cases again and check what the run says about it.

    Parameters
    ----------
    results : tuple of CaseResult
        Cases of one run, at least one.
    polyhedron_for_all : bool
        Fly every facet under the polyhedron too, not an evenly spaced sample.
    jobs : int
        Threads.
    progress : callable
        Told (flown, total) facets.

    Returns
    -------
    tuple of CaseReport
        One a case.
    """
    asteroid = results[0].case.asteroid
    ground, mesh = survey_ground(asteroid.mesh), asteroid.mesh
    polyhedron = polyhedron_field(mesh.vertices, mesh.faces, asteroid.gm_m3_s2)
    plan, done, total = (
        WorkPlan(jobs, "threads", None),
        0,
        sum(len(_flyable(result)) for result in results),
    )

    def told(flown: int) -> None:
        nonlocal done
        done += flown
        progress(done, total)

    sample = None if polyhedron_for_all else POLYHEDRON_FACETS
    return tuple(_verify_case(result, ground, polyhedron, sample, plan, told) for result in results)


def _flyable(result: CaseResult) -> IntArray:
    """Rows that say reachable and store a control."""
    solutions = result.solutions
    return np.flatnonzero((solutions.rows["verdict"] == Verdict.REACHABLE) & rows_with_flight(solutions))


def _verify_case(
    result: CaseResult,
    ground: Ground,
    polyhedron: GravityField,
    sample: int | None,
    plan: WorkPlan,
    told: Told,
) -> CaseReport:
    rows = _flyable(result)
    stored = result.solutions.rows[rows]
    work = partial(measure_rows, result.case, result.solutions, ground=ground)
    measured = _gathered(work, rows, CHUNK_ROWS, plan, told)
    checks = {} if len(rows) == 0 else _checks(result, stored, measured)
    if result.case.margin:
        checks |= _level_checks(result, ground)
    clearances = stored["terrain_clearance_min_m"], measured["terrain_clearance_min_m"]
    return CaseReport(
        case=result.case.name,
        facets=len(result.solutions.rows),
        flown=len(rows),
        worst=checks,
        faults=faults_of(result),
        final_thrust_ratio=float(np.max(measured["flown_thrust_ratio_final"], initial=0.0)),
        paths_through_rock=int((clearances[1] < 0.0).sum()),
        clearance_overstated_m=float(np.max(clearances[0] - clearances[1], initial=0.0)),
        polyhedron=_model_error(result, rows, polyhedron, sample, plan),
    )


def _checks(result: CaseResult, stored: NDArray[np.void], measured: NDArray[np.void]) -> dict[str, Worst]:
    """Find the worst facet in every respect."""
    case, facets = result.case, stored["facet"]
    craft = case.spacecraft
    propellant_kg = craft.mass_kg if craft.propellant_kg is None else craft.propellant_kg
    found = {name: measured[name] for name in ("touchdown_miss_m", "touchdown_speed_m_s", "handover_miss_m")}
    found["descent_thrust_excess"] = measured["peak_thrust_ratio_descent"] - 1.0
    found["final_thrust_excess"] = measured["peak_thrust_ratio_final"] - 1.0
    found["ellipsoid_depth"] = -measured["ellipsoid_margin"]
    found["glide_slope_excess_deg"] = -measured["glide_slope_margin_deg"]
    found["propellant_excess"] = measured["fuel_kg"] / propellant_kg - 1.0
    if case.handover == "on_ellipsoid":
        found["handover_off_ellipsoid"] = measured["handover_off_ellipsoid"]
    if case.terrain == "require":
        found["depth_in_rock_m"] = -measured["terrain_clearance_min_m"]
    worst = {name: _worst(values, LIMITS[name], facets) for name, values in found.items()}
    for name in STORED:
        apart = np.abs(stored[name] - measured[name])
        if name == "glide_slope_margin_deg":  # where an arc ends without acceleration it may be understated
            apart = stored[name] - measured[name]
        if name in RELATIVE:
            worst[f"stored_{name}"] = _worst(apart / np.abs(measured[name]), RELATIVE[name], facets)
        elif name in ABSOLUTE:
            worst[f"stored_{name}"] = _worst(apart, ABSOLUTE[name], facets)
    return worst | _against_dop853(result, facets, worst["touchdown_miss_m"].facet)


def _level_checks(result: CaseResult, ground: Ground) -> dict[str, Worst]:
    """Search a sample's thrust levels again, and fly the flights that have them."""
    facets, found = check_levels(result, ground)
    if len(facets) == 0:
        return {}
    return {name: _worst(values, MARGIN_LIMITS[name], facets) for name, values in found.items()}


def _against_dop853(result: CaseResult, facets: IntArray, farthest: int) -> dict[str, Worst]:
    """Fly a sample by both integrators, and the facet that is missed by most."""
    chosen = np.union1d(facets[_spread(len(facets), DOP853_FACETS)], farthest)
    apart = []
    for facet in chosen.tolist():
        fast = flown_trajectory(result, facet, integrator="gauss")
        slow = flown_trajectory(result, facet, integrator="dop853")
        ends = [(flown.position_m[-1], flown.velocity_m_s[-1]) for flown in (fast, slow)]
        apart.append([np.linalg.norm(a - b) for a, b in zip(*ends, strict=True)])
    metres, speeds = np.array(apart).T
    return {
        "integrators_apart_m": _worst(metres, LIMITS["integrators_apart_m"], chosen),
        "integrators_apart_m_s": _worst(speeds, LIMITS["integrators_apart_m_s"], chosen),
    }


def _model_error(
    result: CaseResult,
    rows: IntArray,
    polyhedron: GravityField,
    sample: int | None,
    plan: WorkPlan,
) -> ModelError | None:
    """Fly the controls under the polyhedron and measure how far they miss."""
    if len(rows) == 0 or result.case.asteroid.gravity.kind is GravityKind.POLYHEDRON:
        return None
    chosen = rows if sample is None else rows[_spread(len(rows), sample)]
    work = partial(_misses, result, polyhedron)
    misses = _gathered(work, chosen, CHUNK_POLYHEDRON_ROWS, plan, lambda flown: None)
    worst = int(np.argmax(misses))
    facet = int(result.solutions.rows["facet"][chosen[worst]])
    return ModelError(len(chosen), float(np.median(misses)), float(misses[worst]), facet)


def _misses(result: CaseResult, field: GravityField, rows: IntArray) -> FloatArray:
    """Distance from touchdown to target in another field, (n,) m."""
    legs, flights = fly_rows(result.case, result.solutions, rows, field)
    ends = np.array([flown.position_m[-1] for flown in flights])
    targets = np.array([final.target_m for _, final in legs if isinstance(final, FinalArcLeg)])
    return np.asarray(np.linalg.norm(ends - targets, axis=1))


def _gathered(
    work: Callable[[IntArray], NDArray[Any]],
    rows: IntArray,
    size: int,
    plan: WorkPlan,
    told: Told,
) -> NDArray[Any]:
    """Do some work on rows, in chunks on threads, and put the answers in the rows' order."""
    if len(rows) == 0:
        return work(rows)
    answers: dict[int, NDArray[Any]] = {}
    chunks = [rows[i : i + size] for i in range(0, len(rows), size)]
    with closing(run_chunks(work, chunks, plan)) as coming:
        for index, answer in coming:
            assert not isinstance(answer, LostChunk)  # threads lose nothing
            answers[index] = answer
            told(len(answer))
    return np.concatenate([answers[index] for index in range(len(chunks))])


def _spread(count: int, wanted: int) -> IntArray:
    """At most so many indices below a count, evenly spaced, first and last included."""
    return np.unique(np.linspace(0, count - 1, min(count, wanted)).round().astype(np.int64))


def _worst(values: FloatArray, limit: float, facets: IntArray) -> Worst:
    """The largest value; what is no number is the worst of all."""
    place = int(np.argmax(np.where(np.isnan(values), np.inf, values)))
    failing = int((~(values <= limit)).sum())
    return Worst(float(values[place]), limit, int(facets[place]), failing)


def _badness(worst: Worst) -> float:
    return np.inf if np.isnan(worst.value) else worst.value / worst.limit

"""Whether stored chains of flybys do what they say: flown again by another integrator and ephemeris.

Spacecraft and asteroids are flown by scipy's DOP853, with positions that jplephem evaluates straight from
the kernel, in ICRF axes: neither the integrator, nor the pieces of the ephemeris, nor the frame is that of
the search and its re-flight. What cannot be true in a record is a fault before anything flies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import GM_SUN_M3_S2, OBLIQUITY_RAD
from landing_cli.flight.elements import states_of
from landing_cli.results.verification import Check, Report
from landing_cli.sources.ephemeris_points import BODIES, Points, heliocentric_points
from landing_cli.tour.ephemeris import GM_M3_S2
from landing_cli.tour.escape_records import EscapeMap
from landing_cli.tour.forces import EARTH_J2, EARTH_RADIUS_M
from landing_cli.tour.records import Flyby, FlybyChain, Leg
from landing_cli.tour.run_records import ChainEntry, TourFacts
from landing_cli.tour.targets import diameter_m
from landing_cli.tour.verify_escape import verify_map

FloatArray = NDArray[np.float64]

RELATIVE_TOLERANCE = 3e-14
ABSOLUTE_TOLERANCE = np.repeat([1e-3, 1e-10], 3)  # m, m/s

# What a flight may miss or differ by at most.
LIMITS: Mapping[str, float] = {
    "miss_m": 200.0,  # of spacecraft and asteroid, both flown again
    "stored_path_m": 100.0,
    "stored_speed_m_s": 1e-4,
    "stored_phase_angle_rad": 1e-8,
    "stored_geocentric_distance_m": 100.0,
    "delta_v_excess_m_s": 1e-6,  # over the limit of the search
    "late_s": 1e-3,  # after the last date
    "geocentric_distance_excess_m": 100.0,
}
SEARCH_ONLY = ("delta_v_excess_m_s", "late_s", "geocentric_distance_excess_m")

_GM = np.array([GM_M3_S2[name] for name in BODIES])
_EARTH = BODIES.index("Earth")
_COSINE, _SINE = math.cos(OBLIQUITY_RAD), math.sin(OBLIQUITY_RAD)
_TO_ICRF = np.array([[1.0, 0.0, 0.0], [0.0, _COSINE, -_SINE], [0.0, _SINE, _COSINE]])


def verify_run(
    entries: tuple[Any, ...],
    *,
    polyhedron_for_all: bool = False,
    jobs: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[Report, ...]:
    """Fly every chain again and check what is said about it; of an escape run, evaluate its maps anew.

    Parameters
    ----------
    entries : tuple of ChainEntry or EscapeMap
        Of one run.
    polyhedron_for_all : bool
        Without meaning here.
    jobs : int
        Without meaning here: one kernel file serves one reader.
    progress : callable
        Told (flown, total) chains.

    Returns
    -------
    tuple of Report
        One a chain.
    """
    del polyhedron_for_all, jobs
    if not entries:
        return ()
    if isinstance(entries[0], EscapeMap):
        return tuple(verify_map(entry) for entry in entries)
    reports: list[Report] = []
    with heliocentric_points(entries[0].facts.ephemeris) as points:
        asteroids = _asteroid_states(entries, points)
        for entry in entries:
            reports.append(verify_entry(entry, asteroids, points))
            progress(len(reports), len(entries))
    return tuple(reports)


def verify_entry(
    entry: ChainEntry, asteroids: Mapping[tuple[int, float], FloatArray], points: Points
) -> Report:
    """Fly one chain again and check what is said about it.

    Parameters
    ----------
    entry : ChainEntry
        The chain.
    asteroids : mapping of (int, float) to (6,) float
        States of its asteroids, by row and time of the flyby; ICRF axes.
    points : callable
        Positions of the bodies.

    Returns
    -------
    Report
    """
    chain = entry.chain
    fault = fault_of(entry)
    if fault or chain.nbody_legs is None or chain.status != "flown":
        return Report(entry.name, chain.status, False, {}, fault)
    try:
        states, path_m = _flown_again(entry, chain.nbody_legs, points)
    except ArithmeticError as error:
        return Report(entry.name, chain.status, True, {}, str(error))
    there = np.array([asteroids[leg.target, leg.arrival_t_s] for leg in chain.nbody_legs])
    earth = np.array([points(leg.arrival_t_s)[_EARTH] for leg in chain.nbody_legs])
    distances = np.linalg.norm(there[:, :3] - earth, axis=1)
    passing = states[:, 3:] - there[:, 3:]
    limits = entry.facts.limits
    values = {
        "miss_m": float(np.linalg.norm(states[:, :3] - there[:, :3], axis=1).max()),
        "stored_path_m": path_m,
        "stored_speed_m_s": _largest(chain.flybys, "speed_m_s", np.linalg.norm(passing, axis=1)),
        "stored_phase_angle_rad": _largest(chain.flybys, "phase_angle_rad", _phase(there[:, :3], passing)),
        "stored_geocentric_distance_m": _largest(chain.flybys, "geocentric_distance_m", distances),
        "delta_v_excess_m_s": max(0.0, chain.nbody_delta_v_m_s - limits.delta_v_m_s),
        "late_s": max(0.0, chain.nbody_legs[-1].arrival_t_s - limits.end_t_s),
        "geocentric_distance_excess_m": max(0.0, float(distances.max()) - limits.geocentric_distance_m),
    }
    if entry.facts.kind != "search":
        values = {name: value for name, value in values.items() if name not in SEARCH_ONLY}
    worst = {name: Check(value, LIMITS[name]) for name, value in values.items()}
    return Report(entry.name, chain.status, True, worst, "")


def fault_of(entry: ChainEntry) -> str:
    """Say what cannot be true in a record.

    Parameters
    ----------
    entry : ChainEntry
        The chain.

    Returns
    -------
    str
        Empty where nothing is wrong.
    """
    chain, facts = entry.chain, entry.facts
    legs = chain.nbody_legs
    if chain.status == "flown" and (legs is None or entry.path is None or len(chain.flybys) != len(legs)):
        return "is called flown, and its N-body flight is not whole"
    if chain.status == "broken" and not chain.message:
        return "is called broken without a reason"
    if chain.departure_t_s != facts.departure.t_s:
        return "departs at another time than the run"
    for kind in (chain.legs, legs or ()):
        fault = _legs_fault(kind, chain, facts)
        if fault:
            return fault
    for flyby, leg in zip(chain.flybys, legs or (), strict=False):
        magnitude = facts.targets.absolute_magnitude[leg.target]
        size = float(diameter_m(magnitude, facts.albedo))
        if flyby.t_s != leg.arrival_t_s:
            return f"the flyby of {flyby.designation} is not at the end of its leg"
        if not (math.isnan(size) or math.isclose(flyby.diameter_m, size, rel_tol=1e-9)):
            return f"{flyby.designation} is {flyby.diameter_m:.6g} m large; H says {size:.6g} m"
    return ""


def _legs_fault(legs: Sequence[Leg], chain: FlybyChain, facts: TourFacts) -> str:
    before = chain.departure_t_s
    for leg in legs:
        if not before <= leg.burn_t_s < leg.arrival_t_s:
            return (
                f"the leg to {leg.designation} begins before the flyby ahead of it, or ends before it begins"
            )
        if facts.targets.designations[leg.target] != leg.designation:
            return f"{leg.designation} is another asteroid in the list of targets"
        if not np.isfinite(leg.delta_v_m_s).all():
            return f"the burn to {leg.designation} is no number"
        before = leg.arrival_t_s
    if len({leg.target for leg in legs}) != len(legs):
        return "passes an asteroid twice"
    return ""


def _flown_again(entry: ChainEntry, legs: Sequence[Leg], points: Points) -> tuple[FloatArray, float]:
    """States at the flybys, (k, 6) in ICRF axes, and the largest distance from the stored path, m."""
    assert entry.path is not None  # a chain without one is a fault
    departure, path = entry.facts.departure, entry.path
    state = np.concatenate([_TO_ICRF @ departure.position_m, _TO_ICRF @ departure.velocity_m_s])
    bounds = [departure.t_s, *(leg.burn_t_s for leg in legs), legs[-1].arrival_t_s]
    at_flybys: dict[float, FloatArray] = {}
    farthest = 0.0
    for arc in range(len(bounds) - 1):
        if arc:
            state = np.concatenate([state[:3], state[3:] + _TO_ICRF @ legs[arc - 1].delta_v_m_s])
        if bounds[arc + 1] <= bounds[arc]:
            continue
        own = path.arc == arc
        arrivals = [leg.arrival_t_s for leg in legs if bounds[arc] < leg.arrival_t_s <= bounds[arc + 1]]
        times = np.union1d(np.clip(path.t_s[own], bounds[arc], bounds[arc + 1]), [*arrivals, bounds[arc + 1]])
        states = _integrated(state[None], bounds[arc], times, points)[:, 0]
        at_flybys |= {t: states[np.searchsorted(times, t)] for t in arrivals}
        there = states[np.searchsorted(times, np.clip(path.t_s[own], bounds[arc], bounds[arc + 1])), :3]
        if own.any():
            gaps = np.linalg.norm(there - path.position_m[own] @ _TO_ICRF.T, axis=1)
            farthest = max(farthest, float(gaps.max()))
        else:
            farthest = math.nan
        state = states[-1]
    return np.array([at_flybys[leg.arrival_t_s] for leg in legs]), farthest


def _asteroid_states(entries: Sequence[ChainEntry], points: Points) -> dict[tuple[int, float], FloatArray]:
    """States of all asteroids at all flybys, those of one epoch flown together."""
    targets = entries[0].facts.targets
    wanted = {
        (leg.target, leg.arrival_t_s)
        for entry in entries
        if entry.chain.status == "flown" and not fault_of(entry)
        for leg in entry.chain.nbody_legs or ()
    }
    states = states_of(targets.elements, GM_SUN_M3_S2).reshape(-1, 2, 3) @ _TO_ICRF.T
    found: dict[tuple[int, float], FloatArray] = {}
    epochs = targets.elements.epoch_t_s
    for epoch in sorted({float(epochs[row]) for row, _ in wanted}):
        own = sorted((row, t) for row, t in wanted if epochs[row] == epoch)
        rows = sorted({row for row, _ in own})
        for side in (-1.0, 1.0):  # flybys before and after the epoch
            times = np.array(sorted({t for _, t in own if (t - epoch) * side >= 0.0}))[:: int(side)]
            if times.size:
                flown = _integrated(states[rows].reshape(-1, 6), epoch, times, points)
                place = {float(t): i for i, t in enumerate(times)}
                found |= {(row, t): flown[place[t], rows.index(row)] for row, t in own if t in place}
    return found


def _integrated(states: FloatArray, start_s: float, times_s: FloatArray, points: Points) -> FloatArray:
    """Fly n bodies, (n, 6) in ICRF axes, to k times in their order: (k, n, 6)."""
    from scipy.integrate import solve_ivp

    if times_s[-1] == start_s:
        return np.repeat(states[None], len(times_s), axis=0)

    def rates(t: float, y: FloatArray) -> FloatArray:
        flat = y.reshape(-1, 6)
        return np.concatenate([flat[:, 3:], _accelerations(flat[:, :3], points(t))], axis=1).ravel()

    flown = solve_ivp(
        rates,
        (start_s, float(times_s[-1])),
        states.ravel(),
        method="DOP853",
        t_eval=times_s,
        rtol=RELATIVE_TOLERANCE,
        atol=np.tile(ABSOLUTE_TOLERANCE, len(states)),
    )
    if not flown.success:
        raise ArithmeticError(f"the second integrator gives up: {flown.message}")
    return np.ascontiguousarray(flown.y.T).reshape(len(times_s), -1, 6)


def _accelerations(position_m: FloatArray, bodies_m: FloatArray) -> FloatArray:
    """Heliocentric accelerations of n bodies, (n, 3) in ICRF axes: point masses, and the Earth's J2."""
    radius = np.linalg.norm(position_m, axis=1, keepdims=True)
    pull = -GM_SUN_M3_S2 * position_m / radius**3
    to = bodies_m[None] - position_m[:, None]
    pull += np.einsum("b,nbi->ni", _GM, to / np.linalg.norm(to, axis=2, keepdims=True) ** 3)
    pull -= _GM @ (bodies_m / np.linalg.norm(bodies_m, axis=1, keepdims=True) ** 3)
    x, y, z = (-to[:, _EARTH]).T  # from the Earth's centre
    square = x * x + y * y + z * z
    factor = -1.5 * EARTH_J2 * _GM[_EARTH] * EARTH_RADIUS_M**2 / square**2.5
    high = 5.0 * z * z / square
    return pull + np.column_stack(
        [factor * x * (1.0 - high), factor * y * (1.0 - high), factor * z * (3.0 - high)]
    )


def _phase(asteroid_m: FloatArray, passing_m_s: FloatArray) -> FloatArray:
    """Angle Sun - asteroid - approaching spacecraft, which comes from where it flies away from."""
    cosine = np.sum(asteroid_m * passing_m_s, axis=1) / (
        np.linalg.norm(asteroid_m, axis=1) * np.linalg.norm(passing_m_s, axis=1)
    )
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def _largest(flybys: Sequence[Flyby], name: str, again: FloatArray) -> float:
    return float(np.abs(np.array([getattr(flyby, name) for flyby in flybys]) - again).max())

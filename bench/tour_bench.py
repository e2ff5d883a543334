"""Lambert arcs beside lamberthub's izzo2015, Kepler's problem, and flights in N-body.

``python -m bench.tour_bench`` prints solves a CPU second. All kernels are compiled beforehand, lamberthub's
numba code too; both Lambert solvers get the same arcs, and their velocities are compared.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from landing_cli.flight.astronomy import DAY_S, GM_SUN_M3_S2
from landing_cli.flight.elements import OrbitElements, elements_of_catalogue, states_of
from landing_cli.flight.kepler import kepler_batch
from landing_cli.tour.lambert import lambert_arcs, lambert_batch

MU = GM_SUN_M3_S2
SEED = 20210408
YEAR_S = 365.25 * DAY_S
TOUR_S = 1.5 * YEAR_S


def orbits(count: int) -> OrbitElements:
    """Prograde orbits like those of near-Earth asteroids."""
    rng = np.random.default_rng(SEED)
    return elements_of_catalogue(
        2_458_666.5,
        rng.uniform(0.7, 2.5, count),
        rng.uniform(0.0, 0.7, count),
        rng.uniform(0.0, 30.0, count),
        *(rng.uniform(0.0, 360.0, count) for _ in range(3)),
    )


def rate(work: Callable[[], object], solves: int, rounds: int = 5) -> float:
    """Most solves a CPU second in some rounds."""
    work()
    best = np.inf
    for _ in range(rounds):
        begun = time.process_time()
        work()
        best = min(best, time.process_time() - begun)
    return solves / best


def row(name: str, per_second: float, told: str = "") -> None:
    """Print one line of the table."""
    print(f"  {name:44s}{per_second:14,.0f} a CPU second  {told}")


def lambert_rows(count: int, slow_count: int) -> bool:
    """Lambert solvers on the same arcs; whether ours is 20 times as fast and agrees."""
    from lamberthub import izzo2015

    elements = orbits(count)
    start = states_of(elements)
    periods = 2.0 * np.pi * np.sqrt(elements.a_m**3 / MU)
    tof = np.random.default_rng(1).uniform(0.02, 0.98, count) * periods
    end = np.zeros_like(start)
    kepler_batch(MU, start, tof, end)
    first, second = np.ascontiguousarray(start[:, :3]), np.ascontiguousarray(end[:, :3])
    turns, right, out = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.bool_), np.zeros((count, 6))
    ours = rate(lambda: lambert_batch(MU, first, second, tof, turns, right, out), count)
    found: list[np.ndarray] = []

    def theirs() -> None:
        found[:] = [izzo2015(MU, first[i], second[i], tof[i])[0] for i in range(slow_count)]

    hub = rate(theirs, slow_count, rounds=3)
    off = np.linalg.norm(np.array(found) - out[:slow_count, :3], axis=1)
    error = np.linalg.norm(out[:, :3] - start[:, 3:], axis=1)
    row("Lambert, direct arcs", ours, f"worst error {error.max():.0e} m/s")
    row("the same by lamberthub's izzo2015", hub, f"worst difference {off.max():.0e} m/s at its defaults")
    print(f"  ratio: {ours / hub:.0f}")
    turned = (1.0 + np.random.default_rng(2).uniform(0.1, 0.9, count)) * periods
    kepler_batch(MU, start, turned, end)
    second = np.ascontiguousarray(end[:, :3])
    row(
        "Lambert, one revolution",
        rate(lambda: lambert_batch(MU, first, second, turned, turns + 1, right, out), count),
    )
    arcs = np.zeros((3, 6))

    def all_arcs() -> int:
        return sum(lambert_arcs(MU, *first[i], *second[i], turned[i], 1, arcs) for i in range(1000))

    solved = all_arcs()
    row("Lambert, all arcs up to one revolution, from Python", rate(all_arcs, solved))
    row("Kepler, universal variables", rate(lambda: kepler_batch(MU, start, turned, end), count))
    return ours > 20.0 * hub and bool(off.max() < 1.0)


def nbody_rows(count: int) -> None:
    """A catalogue's flight through a tour."""
    from landing_cli.tour.ephemeris import flight_ephemeris
    from landing_cli.tour.nbody import fly

    elements = orbits(count)
    begin = float(elements.epoch_t_s[0])
    begun = time.process_time()
    ephemeris = flight_ephemeris("DE440", begin, begin + TOUR_S)
    reading = time.process_time() - begun
    states = states_of(elements)
    flown, status = fly(states, begin, begin + TOUR_S, ephemeris)
    tight, _ = fly(states, begin, begin + TOUR_S, ephemeris, tolerance=1e-10)
    off = np.linalg.norm((flown - tight)[:, :3], axis=1)
    per_second = rate(lambda: fly(states, begin, begin + TOUR_S, ephemeris), count, rounds=2)
    told = f"{np.nanmedian(off):.0e} m median, {np.nanmax(off):.0e} m worst, against a tighter step"
    row("N-body, flights of 1.5 years", per_second, told)
    print(
        f"  18,180 of them: {18_180 / per_second:.1f} s; {int((status != 0).sum())} of {count} did not arrive"
    )
    print(f"  reading DE440 for the flight: {1e3 * reading:.0f} ms")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m bench.tour_bench", description=__doc__.splitlines()[0])
    parser.add_argument("--arcs", type=int, default=100_000)
    parser.add_argument("--flights", type=int, default=1000)
    options = parser.parse_args()
    print("kernels compiled beforehand; one core")
    fast = lambert_rows(options.arcs, 3000)
    nbody_rows(options.flights)
    if not fast:
        raise SystemExit(1)


if __name__ == "__main__":
    main()

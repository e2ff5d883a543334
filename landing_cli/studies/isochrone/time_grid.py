"""The times of flight at which facets are asked: a grid, and a fixed halving of its steps.

Every time that a facet may ever be asked at is a place of one ladder, so that facets whose intervals end in
the same step share their cases, and the same question is the same floating-point number whoever asks it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.body.mesh import facet_centroids
from landing_cli.errors import InputRefused
from landing_cli.reach.records import LandingCase
from landing_cli.scenario.schema_isochrone import MOST_STEPS, IsochroneSection

# Gravity and the mass that is burnt may make the shortest flight shorter than the crossing by some percent.
SHORTER = 0.9

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class TimeGrid:
    """Times of flight, and the ladder of times between them.

    Attributes
    ----------
    tof_s : (k,) float, s
        Ascending; every facet is asked at each of them.
    halvings : int
        How often a step is halved where a verdict changes in it.
    """

    tof_s: FloatArray
    halvings: int

    @property
    def parts(self) -> int:
        """Into how many parts the halvings cut a step."""
        return 1 << self.halvings

    @property
    def places(self) -> int:
        """How many times the ladder has."""
        return (len(self.tof_s) - 1) * self.parts + 1

    @property
    def on_grid(self) -> IntArray:
        """Places of the grid's own times, (k,) int."""
        return np.arange(len(self.tof_s), dtype=np.int64) * self.parts

    def times_s(self, places: ArrayLike) -> FloatArray:
        """Return the times of flight at places of the ladder, s; exactly the grid's own at its places."""
        step, part = np.divmod(np.asarray(places, dtype=np.int64), self.parts)
        before, after = self.tof_s[step], self.tof_s[np.minimum(step + 1, len(self.tof_s) - 1)]
        return np.asarray(before + (after - before) * (part / self.parts))

    @property
    def finest_s(self) -> float:
        """Longest distance between neighbours on the ladder, s: how closely an end is known."""
        return float(np.diff(self.tof_s).max()) / self.parts


def time_grid(
    section: IsochroneSection, cases: Iterable[LandingCase], scenario_tofs_s: Iterable[float]
) -> TimeGrid:
    """Lay the grid out that a scenario asks for.

    Parameters
    ----------
    section : IsochroneSection
        Range, step and tolerance.
    cases : iterable of LandingCase
        One an initial state.
    scenario_tofs_s : iterable of float, s
        Times of flight of ``reach run``; those within the range are put into the grid.

    Returns
    -------
    TimeGrid

    Raises
    ------
    InputRefused
        The range holds no time, or too many steps.
    """
    own, asked = tuple(cases), sorted(scenario_tofs_s)
    first = section.tof_min_s if section.tof_min_s != "auto" else _first_s(own, asked[0], section.step_s)
    last = section.tof_max_s if section.tof_max_s != "auto" else asked[-1]
    if last <= first:
        raise InputRefused(
            f"the range of times of flight from {first:g} to {last:g} s is empty",
            where="isochrone",
            fix="give isochrone.tof_min_s and tof_max_s, or --tof-s FIRST:LAST:STEP",
        )
    steps = math.ceil((last - first) / section.step_s * (1.0 - 1e-12))
    if steps > MOST_STEPS:
        raise InputRefused(
            f"{section.step_s:g} s makes {steps} steps from {first:g} to {last:g} s",
            where="isochrone.step_s",
            fix=f"lengthen it: at most {MOST_STEPS} steps",
        )
    even = (first + section.step_s * k for k in range(steps))
    times = {f"{t:.12g}": float(f"{t:.12g}") for t in even}
    times |= {f"{t:.12g}": t for t in (first, last, *asked) if first <= t <= last}
    tof_s = np.array(sorted(times.values()))
    longest = float(np.diff(tof_s).max())
    halvings = max(0, math.ceil(math.log2(longest / section.tolerance_s) - 1e-9))
    return TimeGrid(tof_s, halvings)


def _first_s(cases: tuple[LandingCase, ...], shortest_asked_s: float, step_s: float) -> float:
    """Shortest time worth asking: a little less than the crossing, or what the scenario asks if less."""
    crossing = SHORTER * min(_crossing_s(case) for case in cases)
    final = max(case.final_stage_s for case in cases)
    first = step_s * math.floor(min(crossing, shortest_asked_s) / step_s)
    return max(first, min(step_s * (math.floor(final / step_s) + 1.0), shortest_asked_s))


def _crossing_s(case: LandingCase) -> float:
    """Time in which full thrust and the initial speed span the distance to the nearest facet and stop there.

    With gravity, mass and rotation left out, a flight of duration t that ends at rest spans at most
    v t / 2 + a t^2 / 4.
    """
    spin = np.array([0.0, 0.0, case.asteroid.rotation_rate_rad_s])
    speed = float(np.linalg.norm(case.velocity_m_s + np.cross(spin, case.position_m)))
    away = facet_centroids(case.asteroid.mesh) - case.position_m
    distance = float(np.sqrt(np.einsum("ij,ij->i", away, away).min()))
    acceleration = case.spacecraft.thrust_max_n / case.spacecraft.mass_kg
    return (math.sqrt(speed**2 + 4.0 * acceleration * distance) - speed) / acceleration

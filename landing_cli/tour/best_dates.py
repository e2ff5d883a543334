"""The instants of a fixed sequence of flybys, each from a list: the best path through all of them.

Burns are at the departure and at each flyby, so a burn depends on three instants in a row: where the arc
before it came from, where it stands, and where it leads. Dynamic programming over arcs finds the best
sequence exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import DAY_S, GM_SUN_M3_S2
from landing_cli.tour.ephemeris import Ephemeris
from landing_cli.tour.lambert import solve_lambert
from landing_cli.tour.nbody import fly
from landing_cli.tour.records import Departure, FlybyChain, Leg
from landing_cli.tour.shooting import shoot

FloatArray = NDArray[np.float64]

_COASTS_D = (10.0, 20.0, 40.0)


@dataclass(frozen=True, eq=False)
class Window:
    """One asteroid at the instants at which it may be flown by.

    Attributes
    ----------
    row : int
        Of the targets.
    designation : str
    t_s : (n,) float, s
        TDB seconds past J2000.
    states : (n, 6) float, m and m/s
        Heliocentric, ecliptic and equinox J2000.
    """

    row: int
    designation: str
    t_s: FloatArray
    states: FloatArray


@dataclass(frozen=True, eq=False)
class _Arcs:
    """Arcs to the n instants of a window, m to each.

    ``leaving`` and ``arriving`` (m, n, 3): velocities; ``origin`` (m,): instant of the window before;
    ``revolutions`` (m,).
    """

    leaving: FloatArray
    arriving: FloatArray
    origin: NDArray[np.int64]
    revolutions: NDArray[np.int64]


def best_chain(
    windows: Sequence[Window],
    departure: Departure,
    revolutions_max: int,
    ephemeris: Ephemeris,
    wanted_m_s: Sequence[float] | None = None,
) -> FlybyChain | None:
    """Choose an instant from each window.

    Parameters
    ----------
    windows : sequence of Window
        In the order of the flybys.
    departure : Departure
        Where the flight begins, with its first burn.
    revolutions_max : int
        Whole revolutions that an arc may make.
    ephemeris : Ephemeris
        Over the flight.
    wanted_m_s : sequence of float, m/s, optional
        Burns that the chain should come nearest to, in the sum of squares; else the sum of burns is least.

    Returns
    -------
    FlybyChain or None
        The first leg is found in N-body: next to the Earth a two-body arc is no guide. Later legs are
        two-body. None where no instant can be reached.
    """
    first, arriving = _first_burns(windows[0], departure, ephemeris)
    size = np.linalg.norm(first, axis=1)
    cost = _cost(size, None if wanted_m_s is None else wanted_m_s[0])[None]
    arcs = _Arcs(first[None], arriving[None], np.zeros(1, np.int64), np.zeros(1, np.int64))
    steps = [(arcs, np.zeros(cost.shape, np.int64))]
    for number, (here, there) in enumerate(pairwise(windows), 1):
        following = _arcs_between(here, there, revolutions_max)
        wanted = None if wanted_m_s is None else wanted_m_s[number]
        cost, source = _extended(cost, steps[-1][0].arriving, following, wanted)
        steps.append((following, source))
    if not np.isfinite(cost).any():
        return None
    return _traced(windows, departure, steps, np.unravel_index(int(np.argmin(cost)), cost.shape))


def _cost(burn: FloatArray, wanted: float | None) -> FloatArray:
    value = burn if wanted is None else (burn - wanted) ** 2
    return np.where(np.isnan(value), np.inf, value)


def _extended(
    cost: FloatArray, arriving: FloatArray, following: _Arcs, wanted: float | None
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Least cost up to each following arc, (m, n), and the arc before it, (m, n)."""
    total = np.empty((len(following.origin), following.leaving.shape[1]))
    source = np.zeros(total.shape, np.int64)
    for row, origin in enumerate(following.origin):
        burns = np.linalg.norm(following.leaving[row][None] - arriving[:, origin][:, None], axis=2)
        sums = _cost(burns, wanted) + cost[:, origin][:, None]
        source[row] = np.argmin(sums, axis=0)
        total[row] = np.min(sums, axis=0)
    return total, source


def _traced(
    windows: Sequence[Window],
    departure: Departure,
    steps: Sequence[tuple[_Arcs, NDArray[np.int64]]],
    end: tuple[np.intp, ...],
) -> FlybyChain:
    """Follow the best path back from its last arc and instant."""
    row, place = (int(index) for index in end)
    legs: list[Leg] = []
    for number in range(len(windows) - 1, -1, -1):
        window, (arcs, source) = windows[number], steps[number]
        before, origin = int(source[row, place]), int(arcs.origin[row])
        burn, t_s = arcs.leaving[row, place], departure.t_s
        if number:
            burn = burn - steps[number - 1][0].arriving[before, origin]
            t_s = float(windows[number - 1].t_s[origin])
        turns = int(arcs.revolutions[row])
        legs.append(Leg(window.row, window.designation, t_s, float(window.t_s[place]), burn, turns))
        row, place = before, origin
    return FlybyChain(departure.t_s, tuple(reversed(legs)), None, (), "hint")


def _arcs_between(here: Window, there: Window, revolutions_max: int) -> _Arcs:
    """All two-body arcs between the instants of two windows; NaN where there is none."""
    kinds = [(0, False), *((n, right) for n in range(1, revolutions_max + 1) for right in (False, True))]
    a, b = len(here.t_s), len(there.t_s)
    i, j = (index.ravel() for index in np.meshgrid(np.arange(a), np.arange(b), indexing="ij"))
    tof = there.t_s[j] - here.t_s[i]
    possible = tof > 0.0
    shape = (len(kinds) * a, b, 3)
    leaving, arriving = np.full((len(kinds), a * b, 3), np.nan), np.full((len(kinds), a * b, 3), np.nan)
    for kind, (turns, right) in enumerate(kinds):
        leaving[kind, possible], arriving[kind, possible] = solve_lambert(
            here.states[i[possible], :3],
            there.states[j[possible], :3],
            tof[possible],
            GM_SUN_M3_S2,
            turns,
            right,
        )
    turns_of = np.repeat([turns for turns, _ in kinds], a)
    return _Arcs(leaving.reshape(shape), arriving.reshape(shape), np.tile(np.arange(a), len(kinds)), turns_of)


def _first_burns(window: Window, departure: Departure, ephemeris: Ephemeris) -> tuple[FloatArray, FloatArray]:
    """Burns at the departure that meet the instants of a window in N-body, and velocities there, (n, 3)."""
    start = np.concatenate([departure.position_m, departure.velocity_m_s])
    burns, arriving = np.full((len(window.t_s), 3), np.nan), np.full((len(window.t_s), 3), np.nan)
    guesses: list[FloatArray] = []
    for i, (t_s, state) in enumerate(zip(window.t_s, window.states, strict=True)):
        tried = guesses or _guesses(start, departure.t_s, float(t_s), state, ephemeris)
        shots = [shoot(start, departure.t_s, float(t_s), state[:3], g, ephemeris) for g in tried]
        met = [shot for shot in shots if shot.met]
        guesses = []
        if met:
            best = min(met, key=lambda shot: float(np.linalg.norm(shot.delta_v_m_s)))
            burns[i], arriving[i] = best.delta_v_m_s, best.state[3:]
            guesses = [best.delta_v_m_s]  # the next instant is near
    return burns, arriving


def _guesses(
    start: FloatArray, start_t_s: float, t_s: float, state: FloatArray, ephemeris: Ephemeris
) -> list[FloatArray]:
    """Burns of two-body arcs from some points of the coast, away from the Earth."""
    found = []
    for days in _COASTS_D:
        later = start_t_s + min(days * DAY_S, (t_s - start_t_s) / 3.0)
        coasted = fly(start, start_t_s, later, ephemeris)[0][0]
        leaving, _ = solve_lambert(coasted[:3], state[:3], t_s - later, GM_SUN_M3_S2)
        if np.isfinite(leaving).all():
            found.append(leaving[0] - coasted[3:])
    return found


def with_instants(window: Window, keep: NDArray[np.bool_]) -> Window:
    """Keep some of the instants of a window.

    Parameters
    ----------
    window : Window
        All of them.
    keep : (n,) bool
        Which to keep.

    Returns
    -------
    Window
    """
    return replace(window, t_s=window.t_s[keep], states=window.states[keep])

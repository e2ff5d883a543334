"""Arcs under linear thrust acceleration against the replay, and their slopes against differences."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from landing_cli.body.gravity.dipole import dipole_field
from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.flight.legs import LinearAccelerationLeg
from landing_cli.flight.linear_arcs import fly_linear_arcs, positions_between, slopes_between
from landing_cli.flight.replay import replay

W = 3.3117e-4
TIMES = np.array([0.0, 25.0, 60.0, 61.0, 100.0])
START = np.array([-9000.0, 6000.0, 2000.0, 8.0, -5.0, 3.0])
THRUST = 0.12 * np.random.default_rng(2).uniform(-1.0, 1.0, (5, 3))
FIELDS = {"point": point_mass_field(4.4628e5), "dipole": dipole_field(4.4628e5, 0.5, 15e3)}


def chained(field: GravityField) -> np.ndarray:
    """States at the nodes, arc after arc."""
    states = [START]
    for k in range(len(TIMES) - 1):
        arc = fly_linear_arcs(field, W, TIMES[k : k + 2], states[-1][None], THRUST[k : k + 2])
        states.append(arc.end[0])
    return np.array(states)


@pytest.mark.parametrize("name", FIELDS)
def test_arcs_end_where_dop853_ends(name: str) -> None:
    field = FIELDS[name]
    leg = LinearAccelerationLeg(TIMES, THRUST)
    flown = replay(
        START[:3], START[3:], 500.0, [leg], rotation_rate_rad_s=W, field=field, exhaust_velocity_m_s=1471.0
    )
    states = chained(field)
    assert_allclose(states[-1, :3], flown.position_m[-1], rtol=0, atol=1e-6)
    assert_allclose(states[-1, 3:], flown.velocity_m_s[-1], rtol=0, atol=1e-8)
    arcs = fly_linear_arcs(field, W, TIMES, states[:-1], THRUST)
    inside = flown.t_s < TIMES[-1]
    t = flown.t_s[inside]
    arc = np.searchsorted(TIMES, t, side="right") - 1
    share = (t - TIMES[arc]) / np.diff(TIMES)[arc]
    assert_allclose(positions_between(arcs, arc, share), flown.position_m[inside], rtol=0, atol=1e-5)


@pytest.mark.parametrize("name", FIELDS)
def test_slopes_are_those_of_the_flight(name: str) -> None:
    field = FIELDS[name]
    states = chained(field)[:-1]
    arcs = fly_linear_arcs(field, W, TIMES, states, THRUST)
    arc, share = np.array([0, 1, 3]), np.array([0.3, 1.0, 0.6])
    along = np.random.default_rng(3).normal(size=(3, 3))
    between = slopes_between(arcs, arc, share, along)
    steps = np.repeat([10.0, 1e-2, 1e-3, 1e-3], 3)
    for column, step in enumerate(steps):
        flown = []
        for sign in (1.0, -1.0):
            moved, first, last = states.copy(), THRUST.copy(), THRUST.copy()
            if column < 6:
                moved[:, column] += sign * step
            elif column < 9:
                first[:, column - 6] += sign * step
            else:
                last[:, column - 9] += sign * step
            ends, places = [], []
            for k in range(len(states)):
                one = fly_linear_arcs(
                    field, W, TIMES[k : k + 2], moved[k : k + 1], np.array([first[k], last[k + 1]])
                )
                ends.append(one.end[0])
                places += [
                    float(positions_between(one, np.array([0]), share[[i]])[0] @ along[i])
                    for i in np.flatnonzero(arc == k)
                ]
            flown.append((np.array(ends), np.array(places)))
        ends = (flown[0][0] - flown[1][0]) / (2.0 * step)
        places = (flown[0][1] - flown[1][1]) / (2.0 * step)
        size = np.abs(arcs.end_slope[:, :, column]).max()
        assert_allclose(arcs.end_slope[:, :, column], ends, rtol=0, atol=2e-6 * size)
        assert_allclose(between[:, column], places, rtol=0, atol=2e-6 * np.abs(places).max())

"""The screening: a target that a known burn meets is found, with that burn, at that time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from kernel_calls import from_python

from landing_cli.flight.astronomy import AU_M, DAY_S, GM_SUN_M3_S2
from landing_cli.flight.kepler import propagate_kepler
from landing_cli.tour.coast_scan import FASTEST_M_S, Coasts, coast_from as coast_from_part, scan_targets

coast_from = from_python(coast_from_part)

GRID_T_S = np.arange(0.0, 600.0, 4.0) * DAY_S
CHORD_M_S = 6.0  # what the chord between two times of a 4-day grid may err
CRAFT = np.array([AU_M, 0.0, 0.0, 500.0, math.sqrt(GM_SUN_M3_S2 / AU_M), 200.0])


def lay(limit_m_s: float, taken: int = -1, spread_m_s: float = math.inf) -> Coasts:
    m = len(GRID_T_S)
    coasts = Coasts(
        first=np.zeros(1, dtype=np.int64),
        position_m=np.zeros((1, 3, m)),
        inverse=np.zeros((1, 9, m)),
        reach_s=np.zeros((1, m)),
        base_m_s=np.zeros((1, 3)),
        limit_m_s=np.array([limit_m_s]),
        spread_m_s=np.array([spread_m_s]),
        taken=np.array([[taken]]),
    )
    coast_from(CRAFT.copy(), 0.0, 10.0 * DAY_S, GRID_T_S, coasts, 0)
    return coasts


def passing(burn_m_s: np.ndarray, arrival_t_s: float, relative_m_s: np.ndarray) -> np.ndarray:
    """Positions on the grid of a target that the craft meets after a burn, (1, 3, m)."""
    burnt = CRAFT + np.concatenate([np.zeros(3), burn_m_s])
    met = propagate_kepler(burnt, arrival_t_s, GM_SUN_M3_S2)[0]
    met[3:] += relative_m_s
    states = propagate_kepler(met, GRID_T_S - arrival_t_s, GM_SUN_M3_S2)
    return states[:, :3].T[None].astype(np.float32)


def scan(grid_m: np.ndarray, coasts: Coasts, keep: int = 3) -> tuple[np.ndarray, ...]:
    target = np.zeros((1, keep), dtype=np.int64)
    arrival, estimate, burn = np.zeros((1, keep)), np.zeros((1, keep)), np.zeros((1, keep, 3))
    scan_targets(GRID_T_S, grid_m, coasts, target, arrival, estimate, burn)
    return target[0], arrival[0], estimate[0], burn[0]


@pytest.mark.parametrize("days", [81.3, 217.9, 402.6])
@pytest.mark.parametrize("relative_km_s", [(3.0, -7.0, 2.0), (-11.0, 4.0, 6.0)])
def test_the_burn_that_meets_a_target_is_estimated(days: float, relative_km_s: tuple[float, ...]) -> None:
    burn = np.array([12.0, -15.0, 6.0])
    grid_m = passing(burn, days * DAY_S, 1e3 * np.array(relative_km_s))
    target, arrival, estimate, found = scan(grid_m, lay(100.0))
    at = int(np.argmin(np.abs(arrival[target >= 0] - days * DAY_S)))
    # the estimate may be a better time nearby, but no dearer than the burn that was flown
    assert abs(arrival[at] - days * DAY_S) < 0.5 * DAY_S
    assert estimate[at] <= 1.1 * np.linalg.norm(burn) + CHORD_M_S
    assert np.linalg.norm(found[at]) == pytest.approx(estimate[at], rel=1e-12)


def dense_least(burn_m_s: np.ndarray, arrival_t_s: float, relative_m_s: np.ndarray) -> float:
    """Least linear estimate on times 10 minutes apart, the sensitivity by central differences."""
    times = arrival_t_s + np.arange(-300, 301) * 600.0
    met = propagate_kepler(CRAFT + np.concatenate([np.zeros(3), burn_m_s]), arrival_t_s, GM_SUN_M3_S2)[0]
    met[3:] += relative_m_s
    away = propagate_kepler(met, times - arrival_t_s, GM_SUN_M3_S2) - propagate_kepler(
        CRAFT, times, GM_SUN_M3_S2
    )
    moved = [
        propagate_kepler(CRAFT + sign * np.eye(6)[axis], times, GM_SUN_M3_S2)[:, :3]
        for axis in (3, 4, 5)
        for sign in (1.0, -1.0)
    ]
    slopes = np.stack([0.5 * (moved[k] - moved[k + 1]) for k in (0, 2, 4)], axis=-1)
    return float(np.linalg.norm(np.linalg.solve(slopes, away[:, :3, None])[..., 0], axis=1).min())


@pytest.mark.parametrize(("step_d", "error_m_s"), [(4.0, 6.0), (2.0, 1.5), (1.0, 0.4)])
def test_the_chord_between_times_of_the_grid_errs_by_the_square_of_the_step(
    step_d: float, error_m_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(globals(), "GRID_T_S", np.arange(0.0, 600.0, step_d) * DAY_S)
    burn, relative = np.array([12.0, -15.0, 6.0]), np.array([3e3, -7e3, 2e3])
    _, _, estimate, _ = scan(passing(burn, 217.9 * DAY_S, relative), lay(100.0))
    assert abs(estimate[0] - dense_least(burn, 217.9 * DAY_S, relative)) < error_m_s


def test_taken_targets_limits_and_spreads_are_kept_to() -> None:
    burn = np.array([12.0, -15.0, 6.0])
    grid_m = passing(burn, 217.9 * DAY_S, np.array([3e3, -7e3, 2e3]))
    assert scan(grid_m, lay(100.0))[0][0] == 0
    for coasts in (lay(100.0, taken=0), lay(3.0), lay(100.0, spread_m_s=3.0)):
        target, _, estimate, _ = scan(grid_m, coasts)
        assert (target == -1).all()
        assert np.isinf(estimate).all()


def test_candidates_come_cheapest_first_and_the_dearest_are_dropped() -> None:
    burns = [np.array([0.0, size, 0.0]) for size in (40.0, 10.0, 25.0, 5.0)]
    grid_m = np.concatenate([passing(b, 217.9 * DAY_S, np.array([3e3, -7e3, 2e3])) for b in burns])
    target, _, estimate, _ = scan(grid_m, lay(100.0))
    assert (np.diff(estimate) >= 0.0).all()
    assert target[0] == 3
    assert set(target[:2]) == {3, 1}


def test_no_two_bodies_pass_faster_than_is_assumed() -> None:
    at_au = 0.9
    assert 2.0 * math.sqrt(2.0 * GM_SUN_M3_S2 / (at_au * AU_M)) < FASTEST_M_S

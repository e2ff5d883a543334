"""Paths to begin with: clear of the body on several sides, and nodes where a control changes."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose
from planning_samples import lumpy_case

from landing_cli.body.clearance import signed_distances
from landing_cli.plan.starting_paths import boundary_cubic, refined_times, starting_paths


def test_the_cubic_has_the_boundary_states() -> None:
    case = lumpy_case(landing_velocity_m_s=np.array([0.1, -0.2, 0.3]))
    first, last = boundary_cubic(case, np.array([0.0, case.tof_s]))
    assert_allclose(first, [*case.position_m, *case.velocity_m_s], rtol=1e-12)
    assert_allclose(last, [*case.site.position_m, *case.landing_velocity_m_s], rtol=0, atol=1e-9)


def test_a_blocked_path_leads_round_the_body_on_several_sides() -> None:
    case = lumpy_case(start_longitude_deg=270.0)  # the site looks to +y
    times = np.linspace(0.0, case.tof_s, 81)
    direct = boundary_cubic(case, times)[:, :3]
    paths = starting_paths(case, times, direct)
    assert len(paths) >= 2
    early = (times > 0.0) & (times < 0.9 * case.tof_s)
    assert signed_distances(case.surface, direct[early]).min() < 0.0
    for path in paths:
        assert_allclose(path[[0, -1]], direct[[0, -1]], rtol=0, atol=1e-9)
        assert signed_distances(case.surface, path[early]).min() > case.clearance_m


def test_a_clear_path_stays_as_it_is() -> None:
    case = lumpy_case(start_longitude_deg=90.0, clearance_m=20.0)
    times = np.linspace(0.0, case.tof_s, 81)
    direct = boundary_cubic(case, times)[:, :3]
    (path,) = starting_paths(case, times, direct)
    assert_allclose(path, direct, rtol=0, atol=0)


def test_nodes_gather_where_the_control_changes() -> None:
    times = np.linspace(0.0, 100.0, 11)
    control = np.where(times[:, None] < 45.0, [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0])
    placed = refined_times(times, control, 21)
    assert_allclose(placed[[0, -1]], [0.0, 100.0], rtol=1e-12)
    assert ((placed >= 40.0) & (placed <= 50.0)).sum() >= 11

"""The rows that bind a path, against the distances themselves and against finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from planning_samples import lumpy_case

from landing_cli.body.clearance import signed_distances
from landing_cli.plan.path_rows import path_rows
from landing_cli.plan.records import PlanCase

ENTRY, BUCKET, MARGIN_M = 150, 7, 0.5


@pytest.fixture(scope="module")
def case() -> PlanCase:
    return lumpy_case()


@pytest.fixture(scope="module")
def path(case: PlanCase) -> np.ndarray:
    """From high over the site, aside, and down to it."""
    share = np.linspace(0.0, 1.0, 201)[:, None]
    aside = np.array([1500.0, 0.0, 900.0]) * share * (1.0 - share)
    return case.site.position_m + (1.0 - share) * 9000.0 * case.site.normal + aside


def test_every_bucket_gives_its_worst_sample(case: PlanCase, path: np.ndarray) -> None:
    rows = path_rows(case, path, ENTRY, BUCKET, MARGIN_M)
    clearance = signed_distances(case.surface, path)
    before = clearance[1 : ENTRY + 1] - case.clearance_m - MARGIN_M
    buckets = [before[k : k + BUCKET].min() for k in range(0, len(before), BUCKET)]
    assert_allclose(rows.value[: len(buckets)], buckets, rtol=0, atol=1e-9)
    ground = clearance[ENTRY:-1]
    second = [ground[k : k + BUCKET].min() for k in range(0, len(ground), BUCKET)]
    assert_allclose(rows.value[len(buckets) :][: len(second)], second, rtol=0, atol=1e-9)
    assert_allclose(clearance[rows.sample[: len(buckets)]] - case.clearance_m - MARGIN_M, buckets, atol=1e-9)


@pytest.mark.parametrize("metric", ["surface", "vertices"])
def test_slopes(case: PlanCase, path: np.ndarray, metric: str) -> None:
    case = replace(case, clearance_metric=metric)
    rows = path_rows(case, path, ENTRY, 1, MARGIN_M)
    step = 1e-3
    numeric = np.zeros_like(rows.slope)
    for axis in range(3):
        ahead, behind = (
            path_rows(case, path + s * step * np.eye(3)[axis], ENTRY, 1, MARGIN_M) for s in (1, -1)
        )
        numeric[:, axis] = (ahead.value - behind.value) / (2.0 * step)
    error = np.abs(numeric - rows.slope).max(axis=1)
    assert (error < 1e-5).mean() > 0.97  # the others are within a millimetre of a kink


def test_the_cone_row_is_the_distance_to_its_wall(case: PlanCase) -> None:
    """At height h on the axis the wall is h sin(theta) away; on the wall there is no room."""
    theta, n = case.cone_half_angle_rad, case.site.normal
    aside = np.cross(n, [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside)
    wall = 500.0 * (np.cos(theta) * n + np.sin(theta) * aside)
    path = case.site.position_m + np.array([800.0 * n, wall, 100.0 * n, 0.0 * n])
    rows = path_rows(case, path, 0, 1, 0.0)
    assert_allclose(rows.value[-3:], [800.0 * np.sin(theta), 0.0, 100.0 * np.sin(theta)], atol=1e-9)

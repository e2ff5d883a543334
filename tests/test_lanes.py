"""Lanes against the same kernels on plain numbers, and each lane against other company."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from landing_samples import asteroid, landing_case, rock

from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations, gradients
from landing_cli.body.gravity.harmonics import harmonics_field
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.kernel import kernel
from landing_cli.kernel_lanes import (
    WIDTH,
    add_at_rows,
    any_lane,
    at_rows,
    by_lane,
    choose,
    lane,
    new_lanes,
    put_lane,
    take_lane,
    with_lane,
)
from landing_cli.kernel_record import by_reference
from landing_cli.reach.free_batch import CutBatch, no_cuts
from landing_cli.reach.free_descent import prepare, solve_prepared, survey
from landing_cli.reach.free_flights import NEVER, Question, _solve
from landing_cli.reach.gravity_in_lanes import acceleration, acceleration_and_gradient
from landing_cli.reach.records import Verdict

NAMES = ["add", "sub", "mul", "div", "neg", "sqrt", "exp", "abs", "max", "min", "plain", "chosen", "compared"]


@by_reference
class Numbers(NamedTuple):
    """Arguments and results, plain or in lanes."""

    x: Any  # (n,)
    y: Any  # (n,)
    out: Any  # (n, len(NAMES))
    table: Any  # (rows, 2)


@kernel
def _arithmetic(numbers: Numbers) -> None:
    for k in range(numbers.x.shape[0]):
        x, y, out = numbers.x[k], numbers.y[k], numbers.out[k]
        total = 0.0
        for _ in range(3):
            total += x
        out[0], out[1], out[2], out[3], out[4] = x + y, x - y, x * y, x / y, -x
        out[5], out[6], out[7], out[8], out[9] = math.sqrt(abs(x)), math.exp(x), abs(x), max(x, y), min(x, y)
        out[10] = 2.0 * total - x / 3.0 + max(y, 0.5)
        out[11] = choose((x < y) & (x > -1.0) | (y >= 1.0), x, 2.0)
        out[12] = choose(x <= y, 1.0, choose(x > 0.0, y, x))
        row = choose(x > 0.0, 1.0, 2.0)
        add_at_rows(numbers.table, row, 1, at_rows(numbers.table, row, 0) + x)


@kernel
def _copy_lane(numbers: Numbers, place: int, plain: Any) -> None:
    take_lane(numbers.table, place, plain)
    put_lane(numbers.out, place, plain)


@kernel
def _one_lane(numbers: Numbers, place: int) -> tuple[float, bool, bool]:
    x = numbers.x[0]
    numbers.y[0] = with_lane(x, place, 7.0)
    return lane(x, place), any_lane(x > 1e3), any_lane(x >= lane(x, place))


def numbers_in_lanes(count: int, seed: int = 0) -> tuple[Numbers, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=(2, count, WIDTH))
    numbers = Numbers(new_lanes(count), new_lanes(count), new_lanes((count, len(NAMES))), new_lanes((3, 2)))
    by_lane(numbers.x)[:], by_lane(numbers.y)[:] = x, y
    by_lane(numbers.table)[:] = np.arange(6).reshape(3, 2, 1)
    return numbers, x, y


def test_arithmetic_in_lanes_is_that_of_plain_numbers() -> None:
    numbers, x, y = numbers_in_lanes(50)
    _arithmetic(numbers)
    for place in range(WIDTH):
        plain = Numbers(
            x[:, place].copy(),
            y[:, place].copy(),
            np.zeros((50, len(NAMES))),
            1.0 * np.arange(6).reshape(3, 2),
        )
        _arithmetic(plain)
        out, table = by_lane(numbers.out)[..., place], by_lane(numbers.table)[..., place]
        for k, name in enumerate(NAMES):
            np.testing.assert_array_equal(out[:, k], plain.out[:, k], err_msg=name)
        np.testing.assert_array_equal(table, plain.table)
    np.testing.assert_array_equal(by_lane(numbers.out)[:, 8], np.maximum(x, y))
    np.testing.assert_allclose(by_lane(numbers.out)[:, 6], np.exp(x), rtol=1e-15, atol=0)


@pytest.mark.parametrize("place", range(WIDTH))
def test_a_lane_is_read_and_written_alone(place: int) -> None:
    numbers, x, _ = numbers_in_lanes(1)
    assert _one_lane(numbers, place) == (x[0, place], False, True)
    changed = x[0].copy()
    changed[place] = 7.0
    np.testing.assert_array_equal(by_lane(numbers.y)[0], changed)


@pytest.mark.parametrize("place", range(WIDTH))
def test_a_lane_is_copied_alone_up_to_the_end_of_the_shorter_array(place: int) -> None:
    numbers, _, _ = numbers_in_lanes(1)
    by_lane(numbers.table)[:] = np.arange(6 * WIDTH).reshape(3, 2, WIDTH)
    by_lane(numbers.out)[:] = -1.0
    plain = np.full((2, 4), 9.0)
    _copy_lane(numbers, place, plain)
    np.testing.assert_array_equal(plain.ravel(), [*by_lane(numbers.table)[..., place].ravel(), 9.0, 9.0])
    out = by_lane(numbers.out).reshape(-1, WIDTH)
    np.testing.assert_array_equal(out[:8, place], plain.ravel())
    assert (out[8:] == -1.0).all() and (np.delete(out, place, axis=1) == -1.0).all()


def test_lane_arrays_are_aligned_and_share_memory_with_their_numbers() -> None:
    for shape in (3, (2, 5), (4, 3, 2)):
        array = new_lanes(shape)
        assert array.ctypes.data % 64 == 0
        by_lane(array)[...] = 3.0
        assert by_lane(array).shape == (*array.shape, WIDTH)
        assert bytes(array) == np.full(array.size * WIDTH, 3.0).tobytes()


@kernel
def _fields(kind: Any, params: Any, at: Any, out: Any) -> None:
    for k in range(at.x.shape[0]):
        x, y, z = at.table[k, 0], at.table[k, 1], at.table[k, 2]
        g = acceleration(kind, params, x, y, z)
        both = acceleration_and_gradient(kind, params, x, y, z)
        for i in range(3):
            out.table[k, i] = g[i]
        for i in range(9):
            out.out[k, i] = both[i]


@pytest.mark.parametrize("field", [point_mass_field(4.9), harmonics_field(4.9, 246.0, -0.04, 0.01, -0.006)])
def test_gravity_in_lanes_is_that_of_single_positions(field: GravityField) -> None:
    rng = np.random.default_rng(1)
    position = rng.normal(size=(6, 3, WIDTH)) * 300.0
    at = Numbers(new_lanes(6), new_lanes(1), new_lanes((1, 1)), new_lanes((6, 3)))
    out = Numbers(new_lanes(1), new_lanes(1), new_lanes((6, 9)), new_lanes((6, 3)))
    by_lane(at.table)[:] = position
    _fields(field.kind, field.params.copy(), at, out)
    flat = np.moveaxis(position, 1, 2).reshape(-1, 3)
    g = np.moveaxis(by_lane(out.table), 1, 2).reshape(-1, 3)
    np.testing.assert_allclose(g, accelerations(field, flat), rtol=1e-13, atol=1e-13 * np.abs(g).max())
    H = np.moveaxis(by_lane(out.out)[:, 3:], 1, 2).reshape(-1, 6)
    expected = gradients(field, flat)[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    np.testing.assert_allclose(H, expected, rtol=1e-12, atol=1e-12 * np.abs(H).max())


def cuts_of_many_sizes(position: np.ndarray, case: Any) -> CutBatch:
    """From none to nine planes, at different nodes of some paths, in no order."""
    size, rng = len(position), np.random.default_rng(2)
    planes = rng.integers(0, 10, size)
    node, normal = np.zeros((size, 12), dtype=np.int64), np.zeros((size, 12, 3))
    for i in range(size):
        node[i, : planes[i]] = rng.choice(np.arange(8, 40), planes[i], replace=False)
        for c in range(planes[i]):
            x = position[i, node[i, c]]
            normal[i, c] = x / (x @ x)
    return CutBatch(planes, node, normal)


@pytest.mark.parametrize("tau_free", [False, True], ids=["energy", "margin"])
def test_an_answer_does_not_depend_on_who_shares_the_lanes(tau_free: bool) -> None:
    case = landing_case(tof_s=850.0)
    p = prepare(case, survey(case))
    facets = np.arange(0, 320, 7)
    targets, normals = p.shared.centroids_m[facets] / p.coarse.length_m, p.shared.normals[facets]
    arc = p.shared.bounds.on_arcs_m_s2 / p.coarse.acceleration_m_s2
    question = Question(p.coarse._replace(propellant=2.0), targets, normals, tau_free, p.coarse_tube, arc)
    size = len(facets)
    level, none = np.full(size, 1.02), no_cuts(size, 40)
    free = _solve(question, none, level, NEVER, 40)
    cuts = cuts_of_many_sizes(free.position, p.coarse)
    for retake_from in (NEVER, 5):
        together = CutBatch(*(a.copy() for a in cuts))
        expected = _solve(question, together, level, retake_from, 25)
        for some in (np.array([11]), np.arange(size)[::-1], np.arange(3, 20, 2)):
            part = CutBatch(*(a[some].copy() for a in cuts))
            asked = question._replace(targets=targets[some], normals=normals[some])
            found = _solve(asked, part, level[some], retake_from, 25)
            for name in found._fields:
                np.testing.assert_array_equal(
                    getattr(found, name), getattr(expected, name)[some], err_msg=name
                )
            np.testing.assert_array_equal(part.normal, together.normal[some])
    assert len(np.unique(expected.iterations)) > 3


def test_a_facets_row_does_not_depend_on_its_batch() -> None:
    case = landing_case(asteroid(rock(2)), tof_s=850.0)
    p = prepare(case, survey(case))
    facets = np.arange(0, 320, 5)
    whole = solve_prepared(p, facets)
    assert (whole.rows["verdict"] == Verdict.REACHABLE).sum() > 20
    for some in (facets[::-1], facets[3:4], facets[10:17]):
        part = solve_prepared(p, some)
        places = np.searchsorted(facets, some)
        for name in part.rows.dtype.names:
            np.testing.assert_array_equal(part.rows[name], whole.rows[name][places], err_msg=name)
        for k, place in enumerate(places):
            np.testing.assert_array_equal(part.nodes_of(k), whole.nodes_of(int(place)))

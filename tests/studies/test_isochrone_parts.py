"""The ladder of times, halving and intervals, against brute force over the whole ladder."""

from __future__ import annotations

import types
from typing import Any
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from landing_samples import landing_case

from landing_cli.errors import InputRefused
from landing_cli.reach.records import Verdict
from landing_cli.scenario.schema_isochrone import IsochroneSection
from landing_cli.studies.isochrone import work
from landing_cli.studies.isochrone.intervals import facet_numbers, interval_at, intervals_of, reachable_area
from landing_cli.studies.isochrone.records import SAMPLE_DTYPE, End, GridAnswers
from landing_cli.studies.isochrone.time_grid import TimeGrid, time_grid
from landing_cli.studies.isochrone.work import Study, changes_of, halve_changes, step_of

NO, YES, UNKNOWN = int(Verdict.UNREACHABLE), int(Verdict.REACHABLE), int(Verdict.UNRESOLVED)


def test_the_grid_holds_its_steps_its_end_and_the_scenarios_own_times() -> None:
    section = IsochroneSection(tof_min_s=400.0, tof_max_s=460.0, step_s=25.0, tolerance_s=0.5)
    grid = time_grid(section, [landing_case()], [410.5, 900.0])
    assert grid.tof_s.tolist() == [400.0, 410.5, 425.0, 450.0, 460.0]
    assert grid.halvings == 6
    assert grid.finest_s == 25.0 / 64


def test_places_of_the_ladder_are_the_grids_own_numbers_and_ascend() -> None:
    grid = TimeGrid(np.array([0.1, 0.7, 1.9]), 3)
    assert grid.times_s(grid.on_grid).tolist() == [0.1, 0.7, 1.9]
    every = grid.times_s(np.arange(grid.places))
    assert len(every) == 17
    assert (np.diff(every) > 0).all()
    assert np.diff(every).max() == pytest.approx(grid.finest_s)


def test_a_tolerance_of_a_whole_step_halves_nothing() -> None:
    section = IsochroneSection(tof_min_s=400.0, tof_max_s=450.0, step_s=25.0, tolerance_s=25.0)
    assert time_grid(section, [landing_case()], [900.0]).halvings == 0


def test_the_range_begins_with_the_crossing_at_full_thrust() -> None:
    case = landing_case()
    grid = time_grid(IsochroneSection(), [case], [700.0, 900.0])
    distance = np.linalg.norm(case.asteroid.mesh.corners.mean(axis=1) - case.position_m, axis=1).min()
    rest_to_rest = 2.0 * np.sqrt(distance * 2000.0 / 20.0)
    assert grid.tof_s[-1] == 900.0
    assert 0.75 * rest_to_rest < grid.tof_s[0] <= rest_to_rest
    assert grid.tof_s[0] % 25.0 == 0.0


def test_the_range_begins_after_the_final_stage_and_no_later_than_the_scenario_asks() -> None:
    slow = landing_case(final_stage_s=590.0)
    assert time_grid(IsochroneSection(), [slow], [700.0]).tof_s[0] == 600.0
    assert time_grid(IsochroneSection(tof_max_s=950.0), [slow], [595.0]).tof_s[0] == 595.0


@pytest.mark.parametrize(
    "section",
    [
        IsochroneSection(tof_min_s=900.0),
        IsochroneSection(tof_min_s=250.0, step_s=0.1, tolerance_s=0.1),
    ],
)
def test_a_range_without_a_step_or_with_too_many_is_refused(section: IsochroneSection) -> None:
    with pytest.raises(InputRefused, match="isochrone"):
        time_grid(section, [landing_case()], [900.0])


CASE = landing_case()
LADDERS = st.integers(0, 4).flatmap(
    lambda halvings: st.integers(2, 5).flatmap(
        lambda times: st.tuples(
            st.just(halvings),
            st.just(times),
            st.lists(
                st.lists(
                    st.sampled_from([NO, YES, UNKNOWN]),
                    min_size=(times - 1) * 2**halvings + 1,
                    max_size=(times - 1) * 2**halvings + 1,
                ),
                min_size=1,
                max_size=4,
            ),
        )
    )
)


def asked(grid: TimeGrid, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Facet, place and verdict of all samples that the study would ask, the verdicts being known."""
    shared: Any = types.SimpleNamespace(centroids_m=np.zeros((len(truth), 3)))
    study = Study((CASE,), grid, shared)

    def solve(own: Study, items: np.ndarray, prove: bool = True) -> np.ndarray:
        rows = np.zeros(len(items), dtype=SAMPLE_DTYPE)
        rows["item"] = np.sort(items)
        _, place, facet = own.parted(rows["item"])
        rows["verdict"] = truth[facet, place]
        return rows

    with mock.patch.object(work, "solve_items", solve):
        samples = solve(study, study.grid_items)
        changes = changes_of(study, samples)
        found = [halve_changes(study, chunk) for chunk in changes]
    for chunk, rows in zip(changes, found, strict=True):
        assert np.isin(step_of(study, rows["item"]), chunk["item"]).all()
    every = np.concatenate([samples, *found])
    _, place, facet = study.parted(every["item"])
    return facet, place, every["verdict"]


@settings(max_examples=80, deadline=None)
@given(LADDERS)
def test_intervals_hold_every_sample_and_their_ends_lie_between_neighbours(
    drawn: tuple[int, int, list[list[int]]],
) -> None:
    halvings, times, rows = drawn
    grid, truth = TimeGrid(400.0 + 25.0 * np.arange(times), halvings), np.array(rows)
    facet, place, verdict = asked(grid, truth)
    assert len(set(zip(facet.tolist(), place.tolist(), strict=True))) == len(facet)  # nothing is asked twice
    intervals = intervals_of(grid, facet, place, verdict)
    for f, p, v in zip(facet.tolist(), place.tolist(), verdict.tolist(), strict=True):
        _, found = interval_at(intervals, len(truth), float(grid.times_s(p)))
        assert found[f] == v
    for row in intervals:
        for side, inner, kind, edge in (
            ("before_s", "begin_s", "begin", grid.tof_s[0]),
            ("after_s", "end_s", "end", grid.tof_s[-1]),
        ):
            if row[kind] == End.OPEN:
                assert np.isnan(row[side])
                assert row[inner] == edge
            else:
                assert abs(row[side] - row[inner]) == pytest.approx(grid.finest_s)
                between = 0.5 * (row[side] + row[inner])
                _, found = interval_at(intervals, len(truth), between)
                assert found[row["facet"]] == UNKNOWN
                _, beyond = interval_at(intervals, len(truth), float(row[side]))
                unknown = beyond[row["facet"]] == UNKNOWN and row["verdict"] == YES
                assert row[kind] == (End.UNRESOLVED if unknown else End.REACHED)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 4), st.lists(st.integers(0, 4 * 16), min_size=1, max_size=5))
def test_a_single_change_is_found_exactly_by_a_solve_a_halving(halvings: int, at: list[int]) -> None:
    grid = TimeGrid(400.0 + 25.0 * np.arange(5), halvings)
    change = np.minimum(at, grid.places - 1)
    truth = np.where(np.arange(grid.places) >= change[:, None], YES, NO)
    facet, place, verdict = asked(grid, truth)
    intervals = intervals_of(grid, facet, place, verdict)
    assert intervals["begin_s"].tolist() == grid.times_s(change).tolist()
    inside = change[(change % grid.parts != 0) | (change > 0)]
    assert len(facet) == len(at) * 5 + halvings * len(inside)


def test_a_facets_numbers_sum_its_intervals_up() -> None:
    grid = TimeGrid(np.array([400.0, 500.0, 600.0, 700.0]), 0)
    verdict = np.array([[NO, YES, NO], [YES, NO, NO], [NO, UNKNOWN, NO], [YES, YES, NO]], dtype=np.uint8)
    delta_v = np.where(verdict == YES, [[9.0], [8.0], [7.0], [6.0]], np.nan)
    answers = GridAnswers(verdict, (verdict == NO).astype(np.uint8), delta_v, delta_v)
    facet, place = np.tile(np.arange(3), 4), np.repeat(np.arange(4), 3)
    intervals = intervals_of(grid, facet, place, verdict.reshape(-1))
    rows = facet_numbers(grid, answers, intervals)
    assert rows["verdict"].tolist() == [YES, YES, NO]
    assert rows["intervals"].tolist() == [2, 2, 0]
    assert rows["first_tof_s"][:2].tolist() == [500.0, 400.0]
    assert rows["last_tof_s"][:2].tolist() == [700.0, 700.0]
    assert rows["begin"].tolist() == [End.REACHED, End.OPEN, End.NONE]
    assert rows["end"].tolist() == [End.OPEN, End.OPEN, End.NONE]
    assert rows["least_delta_v_tof_s"][:2].tolist() == [700.0, 700.0]
    assert np.isnan(rows["first_tof_s"][2])
    assert intervals["end"][intervals["facet"] == 1].tolist() == [End.REACHED, End.REACHED, End.OPEN]
    assert intervals["begin"][intervals["facet"] == 1].tolist() == [End.OPEN, End.REACHED, End.UNRESOLVED]
    tof_s, area = reachable_area(intervals, np.array([1.0, 10.0, 100.0]))
    level = [area[np.searchsorted(tof_s, t, side="right") - 1] for t in (400.0, 450.0, 500.0, 600.0, 700.0)]
    assert level == [10.0, 0.0, 1.0, 0.0, 11.0]

"""Isochrone studies with made-up answers: rounds, journal, resume, lost questions; and a small real one."""

from __future__ import annotations

import types
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from isochrone_samples import NO, UNKNOWN, YES, made_up_samples, made_up_verdict
from scenario_samples import MINIMAL, write_minimal

from landing_cli.errors import InputRefused, OutputRefused
from landing_cli.parallel import LostChunk, WorkPlan
from landing_cli.reach import facet_work, pipeline as reach_pipeline
from landing_cli.results.output import journal_path
from landing_cli.results.store import read, write
from landing_cli.results.tree import Dataset, Group
from landing_cli.scenario.load import load
from landing_cli.studies.isochrone import pipeline, recorded, verify, work
from landing_cli.studies.isochrone.records import End
from landing_cli.studies.isochrone.stored import run_from_result

ONE = WorkPlan(1)
TWO_STATES = MINIMAL.replace(
    "    - {name: top, position_m: [0, 0, 900]}\n",
    "    - {name: top, position_m: [0, 0, 900]}\n    - {name: side, position_m: [900, 0, 0]}\n",
)
RANGE = (
    "isochrone.tof_min_s=500",
    "isochrone.tof_max_s=1000",
    "isochrone.step_s=50",
    "isochrone.tolerance_s=1",
)


def study(folder: Path, plan: WorkPlan = ONE, name: str = "run.h5", **more: Any) -> pipeline.Outcome:
    path = write_minimal(folder, TWO_STATES)
    options = pipeline.RunOptions(plan, **more)
    return pipeline.run(load(str(path), RANGE), folder / name, options, lambda done, total: None)


def solve_by(monkeypatch: pytest.MonkeyPatch, solve: Callable[..., Any]) -> None:
    for module in (pipeline, work):
        monkeypatch.setattr(module, "solve_items", solve)


@pytest.fixture
def made_up(monkeypatch: pytest.MonkeyPatch) -> None:
    solve_by(monkeypatch, made_up_samples)
    monkeypatch.setattr(pipeline, "are_compiled", lambda descent: True)
    monkeypatch.setattr(pipeline, "survey", lambda case: types.SimpleNamespace(centroids_m=np.zeros((8, 3))))
    monkeypatch.setattr(pipeline, "in_chunks", partial(facet_work.in_chunks, size=16))


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("isochrone")
    study(folder)
    return folder / "run.h5"


@pytest.mark.usefixtures("made_up")
def test_every_interval_is_found_to_the_tolerance(tmp_path: Path) -> None:
    found = study(tmp_path).run
    assert [result.case.name for result in found.cases] == ["top", "side"]
    for state, result in enumerate(found.cases):
        assert result.grid.finest_s <= 1.0
        for row in result.intervals:
            for side, inner in (("before_s", "begin_s"), ("after_s", "end_s")):
                assert made_up_verdict(state, int(row["facet"]), float(row[inner])) == row["verdict"]
                if np.isfinite(row[side]):
                    outside = made_up_verdict(state, int(row["facet"]), float(row[side]))
                    assert outside != row["verdict"]
                    assert abs(row[side] - row[inner]) <= result.grid.finest_s * 1.001
        facets = result.facets
        assert facets["verdict"].tolist() == [YES] * 7 + [NO]
        assert facets["intervals"].tolist() == [1, 1, 1, 1, 1, 2, 1, 0]
        assert facets["begin"][0] == (End.OPEN if state == 0 else End.REACHED)
        assert facets["begin"][6] == End.UNRESOLVED
        assert facets["end"].tolist() == [End.OPEN] * 3 + [End.REACHED] + [End.OPEN] * 3 + [End.NONE]
        assert facets["unresolved_s"][6] == pytest.approx(20.2, abs=2 * result.grid.finest_s)
        assert result.summary["several"] == 1
        assert result.summary["lost_again"] == 1


@pytest.mark.usefixtures("made_up")
def test_a_stored_study_is_read_back_whole_and_is_up_to_date(tmp_path: Path) -> None:
    first = study(tmp_path).run
    again = study(tmp_path)
    assert again.up_to_date
    for a, b in zip(first.cases, again.run.cases, strict=True):
        assert a.intervals.tobytes() == b.intervals.tobytes()
        assert a.facets.tobytes() == b.facets.tobytes()
        assert np.array_equal(a.answers.delta_v_m_s, b.answers.delta_v_m_s, equal_nan=True)
        assert (a.summary, a.grid.halvings, a.lost) == (b.summary, b.grid.halvings, b.lost)
    assert not journal_path(tmp_path / "run.h5").exists()


@pytest.mark.usefixtures("made_up")
def test_jobs_change_no_number(tmp_path: Path) -> None:
    study(tmp_path, name="one.h5")
    study(tmp_path, WorkPlan(3), name="three.h5")
    assert read(tmp_path / "one.h5").digest == read(tmp_path / "three.h5").digest


def interrupted_after(chunks: int) -> Callable[..., Any]:
    """Stand for the solver, and stop the run once so many chunks are solved."""
    solved = 0

    def solve(*given: Any, prove: bool = True) -> Any:
        nonlocal solved
        if solved == chunks:
            raise KeyboardInterrupt
        solved += 1
        return made_up_samples(*given)

    return solve


@pytest.mark.usefixtures("made_up")
@pytest.mark.parametrize("chunks", [2, 5, 11, 14, 40])
def test_an_interrupted_run_resumes_to_the_same_file_and_solves_no_chunk_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, chunks: int
) -> None:
    study(tmp_path, name="undisturbed.h5")
    solve_by(monkeypatch, interrupted_after(chunks))
    with pytest.raises(KeyboardInterrupt):
        study(tmp_path)
    before = len(recorded_keys(tmp_path / "run.h5"))
    assert 0 < before <= chunks
    with pytest.raises(OutputRefused, match="--resume"):
        study(tmp_path)
    asked: list[int] = []

    def counted(own: Any, items: np.ndarray, prove: bool = True) -> Any:
        asked.extend(items.tolist())
        return made_up_samples(own, items)

    solve_by(monkeypatch, counted)
    study(tmp_path, resume=True)
    assert read(tmp_path / "run.h5").digest == read(tmp_path / "undisturbed.h5").digest
    assert len(set(asked)) == len(asked)


def recorded_keys(output: Path) -> list[str]:
    from landing_cli.results.journal import read_journal

    content = read_journal(journal_path(output))
    return list(content.records) if content else []


@pytest.mark.usefixtures("made_up")
def test_a_lost_question_stands_as_unresolved_and_is_asked_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study(tmp_path, name="undisturbed.h5")
    real_run_chunks = recorded.run_chunks

    def losing(solve: Any, chunks: Any, plan: WorkPlan) -> Any:
        for number, answer in real_run_chunks(solve, chunks, plan):
            if number == 3:
                yield number, LostChunk(chunks[number][:3], "it died")
                if len(chunks[number]) > 3:
                    yield number, solve(chunks[number][3:])
            else:
                yield number, answer

    monkeypatch.setattr(recorded, "run_chunks", losing)
    found = study(tmp_path).run
    assert found.lost_items >= 3
    assert not read(tmp_path / "run.h5").complete
    result, unknown = found.cases[0], 0
    for one in result.lost:
        assert one.reason == "it died"
        place = int(np.flatnonzero(result.grid.tof_s == one.tof_s)[0])
        unknown += int(result.answers.verdict[place, one.facet] == UNKNOWN)
    assert unknown == 3  # of the grid; the others are steps whose changes were not looked into
    assert run_from_result(read(tmp_path / "run.h5")).lost_items == found.lost_items
    monkeypatch.setattr(recorded, "run_chunks", real_run_chunks)
    assert study(tmp_path, resume=True).run.lost_items == 0
    assert read(tmp_path / "run.h5").digest == read(tmp_path / "undisturbed.h5").digest


@pytest.mark.usefixtures("made_up")
def test_a_journal_of_other_questions_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def other_items(own: Any, items: np.ndarray, prove: bool = True) -> Any:
        rows = made_up_samples(own, items)
        rows["item"] += 1
        return rows

    solve_by(monkeypatch, other_items)
    monkeypatch.setattr(pipeline, "changes_of", lambda *given: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        study(tmp_path)
    solve_by(monkeypatch, made_up_samples)
    with pytest.raises(InputRefused, match="never asks"):
        study(tmp_path, resume=True)


def test_at_the_scenarios_times_it_says_what_reach_run_says(real: Path, tmp_path: Path) -> None:
    found = run_from_result(read(real))
    path = write_minimal(tmp_path, TWO_STATES)
    times = [500.0, 650.0, 700.0, 900.0, 1000.0]
    loaded = load(str(path), [f"reach.tof_s={times}"])
    options = reach_pipeline.RunOptions(ONE)
    domain = reach_pipeline.run(loaded, tmp_path / "reach.h5", options, lambda done, total: None).run
    both = 0
    for case in domain.cases:
        result = next(r for r in found.cases if r.case.name == case.initial_state)
        k = int(np.flatnonzero(result.grid.tof_s == case.case.tof_s)[0])
        rows = case.solutions.rows
        assert result.answers.verdict[k].tolist() == rows["verdict"].tolist()
        for name in ("performance_index_m2_s3", "delta_v_m_s", "proved"):
            assert np.array_equal(getattr(result.answers, name)[k], rows[name], equal_nan=True)
        both += int((rows["verdict"] == YES).sum())
    assert 0 < both < 80


def test_ends_are_where_reach_run_changes_its_mind(real: Path, tmp_path: Path) -> None:
    found = run_from_result(read(real))
    result = found.cases[0]
    row = result.intervals[result.intervals["begin"] == End.REACHED][0]
    path = write_minimal(tmp_path, TWO_STATES)
    sides = [float(row["before_s"]), float(row["begin_s"])]
    loaded = load(str(path), [f"reach.tof_s={sides}"])
    domain = reach_pipeline.run(
        loaded, tmp_path / "reach.h5", reach_pipeline.RunOptions(ONE), lambda done, total: None
    ).run
    verdicts = [c.solutions.rows["verdict"][row["facet"]] for c in domain.cases if c.initial_state == "top"]
    assert verdicts == [NO, YES]


@pytest.mark.slow
def test_processes_give_the_same_file(real: Path, tmp_path: Path) -> None:
    study(tmp_path, WorkPlan(2, "loky"))
    assert read(tmp_path / "run.h5").digest == read(real).digest


def test_a_real_study_verifies_and_a_forged_one_does_not(real: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verify, "SAMPLED_ENDS", 6)
    monkeypatch.setattr(verify, "SAMPLED_GRID", 4)
    (good, forged) = run_from_result(read(real)).cases
    intervals = forged.intervals.copy()
    reached = np.flatnonzero(intervals["begin"] == End.REACHED)
    intervals["begin_s"][reached] += 30.0
    intervals["before_s"][reached] += 30.0
    reports = verify.verify_run((good, replace(forged, intervals=intervals)))
    assert [report.verified for report in reports] == [True, False]
    assert reports[0].flights >= 3
    assert reports[0].disagreeing == 0
    assert reports[1].disagreeing > 0
    assert "side" in reports[1].reason


@pytest.mark.parametrize(
    ("where", "change"),
    [
        (("grid", "tof_s"), lambda data: data[::-1]),
        (("grid", "verdict"), lambda data: data + 7),
        (("grid", "verdict"), lambda data: data[:, :-1]),
        (("grid", "delta_v_m_s"), lambda data: data[:-1]),
        (("intervals", "facet"), lambda data: data + 7),
        (("intervals", "begin_s"), lambda data: data * np.nan),
        (("intervals", "end_s"), lambda data: data + 1e6),
        (("intervals", "before_s"), lambda data: data + 1e3),
        (("intervals", "begin"), lambda data: data * 0),
        (("facets", "facet"), lambda data: data[::-1]),
        (("facets", "verdict"), lambda data: data + 3),
    ],
)
def test_a_file_that_no_study_writes_is_refused(
    real: Path, tmp_path: Path, where: tuple[str, str], change: Callable[[np.ndarray], np.ndarray]
) -> None:
    whole = read(real).tree
    group = whole.group("cases", "top", where[0])
    old = group.dataset(where[1])
    with np.errstate(all="ignore"):
        data = change(old.data).astype(old.data.dtype)
    forged = Group({**group.members, where[1]: Dataset(data, "1", "forged", old.dims)}, group.attributes)
    top = whole.group("cases", "top")
    cases = Group({"top": Group({**top.members, where[0]: forged}, top.attributes)})
    tree = Group({**whole.members, "cases": cases}, whole.attributes)
    try:
        write(tmp_path / "forged.h5", tree, {}, {})
    except ValueError:
        return  # HDF5's dimensions refuse it already
    with pytest.raises(InputRefused):
        run_from_result(read(tmp_path / "forged.h5"))

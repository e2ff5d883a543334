"""reach disperse: the same numbers for any jobs, backend and order; kills, exit codes, what is printed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dispersion_samples import FACETS, SAMPLES, SCENARIO, solve_boulder, write_boulder
from numpy.testing import assert_array_equal

from landing_cli.cli.app import main
from landing_cli.errors import ExitCode, InputRefused
from landing_cli.parallel import LostChunk
from landing_cli.results.journal import read_journal
from landing_cli.results.output import journal_path
from landing_cli.results.store import read
from landing_cli.studies.disperse import pair_work, pipeline, recorded, verify

ROOT = Path(__file__).resolve().parent.parent.parent
CASES = ("high_700s", "high_600s")
OVER_POLE = ("--set", "reach.initial_states.0.position_m=[0,0,700]")
AT_REST = ("--set", "reach.initial_states.0.velocity_m_s=[0,0,0]")


@pytest.fixture(autouse=True)
def _inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_boulder(tmp_path)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("undisturbed")
    solve_boulder(folder)
    return folder / "run.h5"


def disperse(*arguments: str, code: int = 0) -> None:
    assert main("reach", ["disperse", "boulder.yaml", "-q", *arguments]) == code


@pytest.mark.parametrize("plan", [("--jobs", "2"), ("--backend", "loky", "--jobs", "2")])
def test_any_jobs_and_backend_give_the_same_file(
    plan: tuple[str, ...], undisturbed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    disperse("-o", "other.h5", *plan)
    assert read(Path("other.h5")).digest == read(undisturbed).digest


def test_chunks_of_any_size_give_the_same_verdicts(
    undisturbed: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(pair_work, "CHUNK_PAIRS", 77)
    run = solve_boulder(tmp_path)
    known = read(undisturbed).tree
    for name, case in zip(CASES, run.cases, strict=True):
        assert_array_equal(case.verdicts, known.group("cases", name).dataset("verdicts").data)


def test_more_samples_leave_the_first_ones_as_they_are(undisturbed: Path, tmp_path: Path) -> None:
    run = solve_boulder(tmp_path, "disperse.samples=14", "disperse.cases=[high_600s]")
    (case,) = run.cases
    known = read(undisturbed).tree.group("cases", "high_600s")
    assert case.verdicts.shape == (14, FACETS)
    assert_array_equal(case.verdicts[:SAMPLES], known.dataset("verdicts").data)
    for name in ("position_m", "velocity_m_s", "mass_kg", "thrust_max_n", "gm_m3_s2", "reachable_area_m2"):
        assert_array_equal(case.samples[name][:SAMPLES], known.group("samples").dataset(name).data)


def test_a_killed_run_continues_to_the_same_file(undisturbed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SIGKILL while the journal grows; what is recorded is not solved again."""
    code = (
        "import sys, time; from landing_cli.studies.disperse import pair_work; pair_work.CHUNK_PAIRS = 64\n"
        "from landing_cli.studies.disperse import pipeline\n"
        "solve = pair_work.verdicts_of\n"
        "def slowly(prepared, facets):\n    time.sleep(0.05); return solve(prepared, facets)\n"
        "pair_work.verdicts_of = slowly\n"
        "pipeline.CHUNK_PAIRS = 1024\n"  # it is the same run
        "from landing_cli.cli.app import main; sys.exit(main('reach', sys.argv[1:]))"
    )
    arguments = ["disperse", "boulder.yaml", "-o", "run.h5", "--jobs", "1"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [sys.executable, "-c", code, *arguments], env=environment, stderr=subprocess.PIPE
    )
    journal, deadline = journal_path(Path("run.h5")), time.monotonic() + 120.0
    while time.monotonic() < deadline and process.poll() is None:
        content = read_journal(journal) if journal.exists() else None
        if content is not None and len(content.records) >= 4:
            break
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    content = read_journal(journal)
    assert content is not None
    assert 4 <= len(content.records) < 25
    known = sum(len(record["verdicts"]) for record in content.records.values())
    with journal.open("r+b") as file:
        file.truncate(journal.stat().st_size - 3)  # and the last record is torn
    disperse("-o", "run.h5", code=ExitCode.REFUSED)
    asked: list[range] = []
    solve = pair_work.PairWork.__call__

    def counted(work: pair_work.PairWork, pairs: range) -> pair_work.Span:
        asked.append(pairs)
        return solve(work, pairs)

    monkeypatch.setattr(pair_work.PairWork, "__call__", counted)
    disperse("-o", "run.h5", "--resume")
    assert not journal.exists()
    assert read(Path("run.h5")).digest == read(undisturbed).digest
    again = sum(map(len, asked))
    assert again <= 2 * SAMPLES * FACETS - known + 64


def test_a_result_that_is_there_is_up_to_date_or_refused(
    undisturbed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("run.h5").write_bytes(undisturbed.read_bytes())
    before = Path("run.h5").stat().st_mtime_ns
    assert main("reach", ["disperse", "boulder.yaml", "-o", "run.h5"]) == 0
    assert "is up to date" in capsys.readouterr().err
    assert main("reach", ["disperse", "boulder.yaml", "-o", "run.h5", "--set", "plan.tof_s=800"]) == 0
    assert "is up to date" in capsys.readouterr().err  # what other missions ask changes nothing
    disperse("-o", "run.h5", "--seed", "2", code=ExitCode.REFUSED)
    assert "seed: 1" in capsys.readouterr().err
    assert Path("run.h5").stat().st_mtime_ns == before
    disperse("-o", "run.h5", "--seed", "2", "--case", "high_600s", "--force")
    assert read(Path("run.h5")).digest != read(undisturbed).digest


@pytest.mark.parametrize(
    "record",
    [
        {"first": np.array([0]), "verdicts": np.array([7], dtype=np.uint8)},
        {"first": np.array([-1]), "verdicts": np.array([1], dtype=np.uint8)},
        {"first": np.array([2 * SAMPLES * FACETS - 1]), "verdicts": np.array([1, 1], dtype=np.uint8)},
        {"first": np.array([0]), "verdicts": np.array([1.0])},
        {"rows": np.array([0])},
    ],
)
def test_a_journal_of_another_kind_is_refused(
    record: dict[str, Any], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(journal: Any, *rest: Any) -> Any:
        journal.append("verdicts/0", record)
        raise InputRefused("stopped")

    with monkeypatch.context() as patch:
        patch.setattr(pipeline, "solve_recorded", interrupted)
        disperse("-o", "run.h5", code=ExitCode.REFUSED)
    disperse("-o", "run.h5", "--resume", code=ExitCode.REFUSED)
    assert "start over with --force" in capsys.readouterr().err


def test_lost_solves_are_unresolved_and_tried_again(
    undisturbed: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    real = recorded.run_chunks

    def losing(work: Any, chunks: Any, plan: Any) -> Any:
        first, *others = chunks
        yield 0, LostChunk(range(5, 8), "its worker died")
        yield from real(work, [first[:5], first[8:], *others], plan)

    with monkeypatch.context() as patch:
        patch.setattr(recorded, "run_chunks", losing)
        disperse("-o", "run.h5", "--json", code=ExitCode.PARTIAL)
    out, err = capsys.readouterr()
    assert json.loads(out)["cases"][0]["unresolved"] == 3
    assert "3 solves were lost to failures" in err
    rows = read(Path("run.h5")).tree.group("cases", "high_700s", "facets")
    assert rows.dataset("unresolved").data[5:8].tolist() == [1, 1, 1]
    high, low = (rows.dataset(f"probability_{end}").data for end in ("high", "low"))
    known = read(undisturbed).tree.group("cases", "high_700s", "facets")
    assert (low[5:8] <= known.dataset("probability_low").data[5:8]).all()
    assert (high[5:8] >= known.dataset("probability_high").data[5:8]).all()
    monkeypatch.setattr(verify, "SAMPLES", 1)
    assert main("landing", ["results", "verify", "run.h5", "-q", "--jobs", "1"]) == 0
    disperse("-o", "run.h5", "--resume")
    assert read(Path("run.h5")).digest == read(undisturbed).digest


def test_json_and_the_table_tell_what_scripts_rely_on(capsys: pytest.CaptureFixture[str]) -> None:
    disperse("--samples", "3", "--seed", "9", "--case", "high_700s", "--json", "-o", "run.h5")
    value = json.loads(capsys.readouterr().out)
    assert (value["run"], value["scenario"]) == ("run.h5", "boulder")
    (case,) = value["cases"]
    assert (case["case"], case["facets"], case["samples"], case["seed"]) == ("high_700s", FACETS, 3, 9)
    assert case["always"] + case["sometimes"] + case["never"] == FACETS
    area = case["reachable_area_m2"]
    assert area["p05"] <= area["p50"] <= area["p95"]
    assert main("landing", ["results", "show", "run.h5", "-q"]) == 0
    assert capsys.readouterr().out.splitlines()[1].split()[:3] == ["high_700s", str(FACETS), "3"]


def test_a_dry_run_counts_the_solves_and_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(tmp_path.rglob("*"))
    disperse("--dry-run", "--json", "--samples", "1000")
    cases = json.loads(capsys.readouterr().out)["cases"]
    assert [(case["case"], case["solves"]) for case in cases] == [(name, 80_000) for name in CASES]
    assert sorted(tmp_path.rglob("*")) == before


def test_nothing_feasible_is_exit_4(capsys: pytest.CaptureFixture[str]) -> None:
    disperse("--set", "spacecraft.thrust_max_n=1", "--samples", "2", code=ExitCode.NOTHING_FEASIBLE)
    assert "no facet is reachable in any sample of any case" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "arguments", "told"),
    [
        (
            "  cases: [high_800s]",
            (),
            "disperse.cases.0: no case 'high_800s'; take one of high_700s, high_600s",
        ),
        ("", ("--case", "high"), "disperse.cases.0"),
        ("", ("--samples", "0"), "--set disperse.samples=0: disperse.samples: 0 is not at least 1"),
        ("  axes: radial_along_cross", (*OVER_POLE, *AT_REST), "take body axes"),
        ("  mass_sigma_kg: 5", (), "disperse.mass_sigma_relative: stands beside mass_sigma_kg"),
        ("", ("--set", "spacecraft.propellant_kg=1950"), "leave less mass than spacecraft.propellant_kg"),
    ],
)  # fmt: skip
def test_what_cannot_be_dispersed_is_refused_by_its_key(
    change: str, arguments: tuple[str, ...], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_boulder(tmp_path, SCENARIO.replace("  samples: 10", f"  samples: 10\n{change}"))
    disperse(*arguments, code=ExitCode.REFUSED)
    assert told in capsys.readouterr().err
    assert not Path("runs").exists()


@pytest.mark.parametrize("absent", ["disperse", "reach"])
def test_a_scenario_without_the_section_says_what_is_needed(
    absent: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before, _, rest = SCENARIO.partition(f"{absent}:\n")
    kept = [line for line in rest.splitlines() if not line.startswith(" ")]
    after = rest[rest.index(kept[0]) :]
    write_boulder(tmp_path, before + after)
    disperse("--jobs", "1", code=ExitCode.REFUSED)
    assert f"{absent}: the scenario has no such section" in capsys.readouterr().err
    disperse("--samples", "5", code=ExitCode.REFUSED)  # options alone disperse nothing
    assert {"disperse": "disperses nothing", "reach": "no such section"}[absent] in capsys.readouterr().err

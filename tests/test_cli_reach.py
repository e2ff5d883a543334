"""reach run with a made-up pipeline: what it is told, what is printed, and the exit codes."""

from __future__ import annotations

import json
import sys
import types
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from scenario_samples import write_minimal
from test_cli_results import NO, YES, stored_run

from landing_cli.cli.app import main
from landing_cli.errors import ExitCode
from landing_cli.parallel.plan import WorkPlan
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import ReachRun, run_from_result
from landing_cli.results.store import read


@dataclass(frozen=True)
class Options:
    plan: WorkPlan
    resume: bool
    force: bool
    compare: bool


@dataclass(frozen=True)
class Outcome:
    run: ReachRun
    up_to_date: bool = False


@dataclass
class FakePipeline:
    """Stands for landing_cli.reach.pipeline; keeps what it was asked."""

    verdicts: list[Verdict]
    up_to_date: bool = False
    asked: Any = None

    def run(
        self,
        loaded: Any,
        output: Path,
        options: Options,
        progress: Callable[[int, int], None],
        say: Callable[[str], None],
    ) -> Outcome:
        self.asked = (loaded.scenario, output, options)
        say("compiling")
        progress(4, 4)
        output.parent.mkdir(exist_ok=True)
        run = run_from_result(read(stored_run(output, self.verdicts)))
        return Outcome(run, self.up_to_date)


@pytest.fixture
def pipeline(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FakePipeline:
    monkeypatch.chdir(tmp_path)
    write_minimal(tmp_path)
    fake = FakePipeline([YES, YES, NO, NO])
    module = types.ModuleType("landing_cli.reach.pipeline")
    module.run, module.RunOptions = fake.run, Options  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "landing_cli.reach.pipeline", module)
    return fake


def test_a_run_prints_its_table_and_says_where_the_result_is(
    pipeline: FakePipeline, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main("reach", ["run", "probe", "--jobs", "3", "--set", "reach.tof_s=800"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[1].split()[:4] == ["top_700s", "4", "2", "2"]
    assert err == "read probe.yaml\ncompiling\nwrote runs/probe-reach-run.h5\n"
    scenario, output, options = pipeline.asked
    assert scenario.reach.tof_s == (800,)
    assert output == Path("runs/probe-reach-run.h5")
    assert options == Options(WorkPlan(3, "threads", None), resume=False, force=False, compare=False)


def test_every_option_reaches_the_pipeline(pipeline: FakePipeline) -> None:
    arguments = [
        "--backend",
        "dask",
        "--scheduler",
        "tcp://h:8786",
        "--resume",
        "--force",
        "--compare",
        "-j",
        "2",
    ]
    assert main("reach", ["run", "probe", "-o", "x.h5", "-q", *arguments]) == 0
    _, output, options = pipeline.asked
    assert output == Path("x.h5")
    assert options == Options(WorkPlan(2, "dask", "tcp://h:8786"), resume=True, force=True, compare=True)


def test_json_goes_alone_to_stdout(pipeline: FakePipeline, capsys: pytest.CaptureFixture[str]) -> None:
    assert main("reach", ["run", "probe", "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["cases"][0]["case"] == "top_700s"
    assert "wrote" in err


def test_an_up_to_date_result_is_said_to_be_so(
    pipeline: FakePipeline, capsys: pytest.CaptureFixture[str]
) -> None:
    pipeline.up_to_date = True
    assert main("reach", ["run", "probe"]) == 0
    assert "is up to date" in capsys.readouterr().err


def test_nothing_feasible_is_exit_4_after_the_table(
    pipeline: FakePipeline, capsys: pytest.CaptureFixture[str]
) -> None:
    pipeline.verdicts = [NO, NO, NO, NO]
    assert main("reach", ["run", "probe"]) == ExitCode.NOTHING_FEASIBLE
    out, err = capsys.readouterr()
    assert "top_700s" in out
    assert "no facet is reachable in any case" in err


def test_a_dry_run_lists_the_cases_and_writes_nothing(
    pipeline: FakePipeline, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(tmp_path.rglob("*"))
    assert main("reach", ["run", "probe", "--dry-run", "--json"]) == 0
    out, _ = capsys.readouterr()
    value = json.loads(out)
    assert [case["case"] for case in value["cases"]] == ["top_700s", "top_900s"]
    assert value["cases"][0]["facets"] == 8
    assert sorted(tmp_path.rglob("*")) == before
    assert pipeline.asked is None


def test_a_refused_scenario_leaves_nothing(
    pipeline: FakePipeline, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main("reach", ["run", "probe", "--set", "reach.tof_s=0"]) == ExitCode.REFUSED
    assert "--set reach.tof_s=0: reach.tof_s.0: 0 is not more than 0" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()
    assert pipeline.asked is None

"""A plan to one facet of a reach result: which case it takes, and what it takes from it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from plan_scenario_samples import SCENARIO, write_lumpy

from landing_cli.cli.app import main
from landing_cli.errors import ExitCode
from landing_cli.plan.stored import PlanRun, run_from_result
from landing_cli.reach.cases import landing_cases
from landing_cli.reach.records import FacetSolutions, Verdict, blank_rows
from landing_cli.reach.stored import CaseResult, ReachRun, run_to_tree
from landing_cli.reach.summary import summarise
from landing_cli.results.identity import RunIdentity
from landing_cli.results.store import read, write
from landing_cli.scenario.build import build
from landing_cli.scenario.load import load
from landing_cli.scenario.sections import for_mission, reach_section
from landing_cli.scenario.show import to_yaml

REACH = """\
reach:
  initial_states: [{name: high, position_km: [-33.8, 30, 0], velocity_m_s: [-0.9, 1.4, 0.2]}]
  tof_s: [1900, 2100]
  final_stage_s: 300
"""
SITE = 805


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two cases; the later one reaches the site for less, the earlier one a facet more."""
    monkeypatch.chdir(tmp_path)
    write_lumpy(tmp_path, SCENARIO.split("plan:")[0] + REACH)
    loaded = load("lumpy")
    built = build(loaded)
    results = []
    for (state, case), fuel in zip(landing_cases(reach_section(loaded), built), (9.0, 7.0), strict=True):
        rows = blank_rows(np.arange(len(built.asteroid.mesh.faces)))
        rows["verdict"] = Verdict.UNREACHABLE
        rows["verdict"][SITE] = Verdict.REACHABLE
        rows["fuel_kg"][SITE] = fuel
        if fuel > 8.0:
            rows["verdict"][SITE + 1], rows["fuel_kg"][SITE + 1] = Verdict.REACHABLE, 9.0
        solutions = FacetSolutions(rows, np.zeros((0, 3)))
        results.append(CaseResult(case, state, solutions, summarise(built.asteroid.mesh, solutions)))
    text = to_yaml(for_mission(loaded.scenario, "reach"))
    identity = RunIdentity("reach run", text, built.shape_sha256, "0.1.0")
    attributes = {"mission": "reach", "complete": 1, **identity.as_dict()}
    write(tmp_path / "reach.h5", run_to_tree(ReachRun(tuple(results))), attributes, {})
    (tmp_path / "lumpy.obj").unlink()  # the result holds the body
    return tmp_path / "reach.h5"


def planned(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[PlanRun, str]:
    assert main("plan", ["bezier", "--from-run", "reach.h5", "--json", *arguments]) in (0, 4)
    out, err = capsys.readouterr()
    return run_from_result(read(Path(json.loads(out)["run"]))), err


@pytest.mark.usefixtures("run")
def test_body_spacecraft_state_and_time_are_those_of_the_cheapest_case(
    capsys: pytest.CaptureFixture[str],
) -> None:
    found, err = planned(capsys, "--facet", str(SITE))
    assert "read reach.h5: case high_2100s" in err
    assert "clearance_m: auto is" in err
    case = found.cases[0].case
    assert case.tof_s == 2100.0 and case.site.facet == SITE
    np.testing.assert_array_equal(case.position_m, [-33800.0, 30000.0, 0.0])
    np.testing.assert_array_equal(case.velocity_m_s, [-0.9, 1.4, 0.2])
    assert case.spacecraft.thrust_max_n == 60.0 and case.asteroid.rotation_rate_rad_s == 3.3117e-4


@pytest.mark.usefixtures("run")
def test_only_a_case_that_reaches_the_facet_is_taken(capsys: pytest.CaptureFixture[str]) -> None:
    assert planned(capsys, "--facet", str(SITE + 1))[0].cases[0].case.tof_s == 1900.0


@pytest.mark.usefixtures("run")
def test_a_case_and_every_plan_key_may_be_chosen(capsys: pytest.CaptureFixture[str]) -> None:
    found, _ = planned(
        capsys,
        *("--facet", str(SITE), "--case", "high_1900s", "--set", "plan.clearance_m=250"),
        *("--set", "spacecraft.thrust_max_n=80"),
    )
    case = found.cases[0].case
    assert (case.tof_s, case.clearance_m, case.spacecraft.thrust_max_n) == (1900.0, 250.0, 80.0)


@pytest.mark.usefixtures("run")
@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--facet", "7"], ExitCode.REFUSED, "facet 7 is reachable in no case of the run"),
        (["--facet", str(SITE), "--case", "low"], ExitCode.REFUSED, "no case 'low'; take one of high_1900s"),
        (["--site", "90,0"], ExitCode.USAGE, "the run has several cases; choose one with --case"),
        (
            ["--facet", "7", "--set", "body.origin=file"],
            ExitCode.USAGE,
            "body and reach are those of the run",
        ),
    ],
)
def test_what_does_not_fit_the_run_is_refused(
    capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, message: str
) -> None:
    assert main("plan", ["bezier", "--from-run", "reach.h5", *arguments]) == code
    assert message in capsys.readouterr().err


@pytest.mark.usefixtures("run")
def test_a_plan_result_is_no_reach_result(capsys: pytest.CaptureFixture[str]) -> None:
    planned(capsys, "--facet", str(SITE), "-o", "plan.h5")
    assert main("plan", ["bezier", "--from-run", "plan.h5", "--facet", "1"]) == ExitCode.REFUSED
    assert "holds a result of 'plan', not of 'reach'" in capsys.readouterr().err

"""plan on the command line: what is printed and stored, the exit codes, and resuming."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plan_scenario_samples import SCENARIO, write_lumpy

from landing_cli.cli.app import main
from landing_cli.errors import ExitCode
from landing_cli.plan import pipeline
from landing_cli.plan.stored import run_from_result, run_to_tree
from landing_cli.plan.tasks import solve_tasks
from landing_cli.results.store import read
from landing_cli.results.tree import digest

CONTRACT = (
    "method",
    "status",
    "tof_s",
    "fuel_kg",
    "peak_thrust_n",
    "clearance_min_m",
    "clearance_metric",
    "landing_angle_deg",
    "cpu_s",
)
FAST_SWEEP = "plan.sweep.longitudes_deg=[0, 90, 195, 270]"


@pytest.fixture(autouse=True)
def _inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_lumpy(tmp_path)


def told(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> tuple[str, str]:
    assert main("plan", arguments) == code
    return capsys.readouterr()


def as_json(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> dict[str, Any]:
    return json.loads(told(capsys, *arguments, "--json", "--quiet", code=code)[0])


def test_a_plan_prints_its_table_and_stores_its_result(capsys: pytest.CaptureFixture[str]) -> None:
    out, err = told(capsys, "bezier", "lumpy")
    lines = out.splitlines()
    assert lines[0].split()[:4] == ["name", "status", "tof_s", "fuel_kg"]
    assert lines[1].split()[:3] == ["bezier_2000s", "planned", "2000"]
    assert err.splitlines()[0] == "read lumpy.yaml"
    assert err.splitlines()[-1] == "wrote runs/lumpy-plan-bezier.h5"
    stored = read(Path("runs/lumpy-plan-bezier.h5"))
    assert stored.mission == "plan" and stored.complete
    assert run_from_result(stored).cases[0].plan.status == "planned"


def test_json_has_the_fields_of_the_contract_and_the_methods_own(capsys: pytest.CaptureFixture[str]) -> None:
    plan = as_json(capsys, "bezier", "lumpy")
    assert set(CONTRACT) <= set(plan)
    assert plan["method"] == "bezier" and plan["status"] == "planned"
    assert plan["clearance_metric"] == "surface" and plan["clearance_min_m"] >= 300.0
    assert {"alpha_m", "line_of_sight", "obstacle_guide_point_m"} <= set(plan)
    assert plan["plans"][0]["fuel_kg"] == plan["fuel_kg"]
    assert plan["cpu_s"] > 0.0


def test_several_times_are_several_plans(capsys: pytest.CaptureFixture[str]) -> None:
    told_ = as_json(capsys, "bezier", "lumpy", "--set", "plan.tof_s=[1900, 2100]")
    assert [plan["tof_s"] for plan in told_["plans"]] == [1900.0, 2100.0]
    assert "fuel_kg" not in told_


def test_the_same_again_is_up_to_date_and_another_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    told(capsys, "bezier", "lumpy")
    assert "is up to date" in told(capsys, "bezier", "lumpy")[1]
    other = ("bezier", "lumpy", "--set", "plan.tof_s=2100")
    err = told(capsys, *other, code=ExitCode.REFUSED)[1]
    assert "holds the result of a different run: scenario: tof_s: [2000] -> tof_s: [2100]" in err
    told(capsys, *other, "--force")
    err = told(capsys, "bezier", "lumpy", "--shortest", code=ExitCode.REFUSED)[1]
    assert "command: plan bezier -> plan bezier --shortest" in err


def test_too_short_a_time_ends_with_4_and_says_what_suffices(capsys: pytest.CaptureFixture[str]) -> None:
    out, err = told(capsys, "bezier", "lumpy", "--set", "plan.tof_s=900", code=ExitCode.NOTHING_FEASIBLE)
    assert "infeasible" in out
    last = err.splitlines()[-1]
    assert " N at 900 s, the thruster gives 60 N; " in last and "s needs " in last
    plan = as_json(capsys, "bezier", "lumpy", "--set", "plan.tof_s=900", code=ExitCode.NOTHING_FEASIBLE)
    assert plan["status"] == "infeasible" and plan["refused_by"] == "thrust"


def test_the_shortest_time_needs_the_whole_thrust(capsys: pytest.CaptureFixture[str]) -> None:
    plan = as_json(capsys, "bezier", "lumpy", "--shortest")
    assert plan["status"] == "planned"
    assert plan["peak_thrust_n"] == pytest.approx(60.0, rel=1e-3)
    assert plan["tof_s"] < 2000.0


def test_free_control_beats_the_curves(capsys: pytest.CaptureFixture[str]) -> None:
    bezier = as_json(capsys, "bezier", "lumpy")
    free = as_json(capsys, "convex", "lumpy", "--bezier-degree", "7", "-o", "free.h5")
    control = as_json(capsys, "convex", "lumpy")
    assert free["method"] == "bezier_free_guides" and control["method"] == "convex"
    assert control["fuel_kg"] < free["fuel_kg"] < bezier["fuel_kg"] * (1.0 + 1e-6)
    assert main("landing", ["results", "verify", "runs/lumpy-plan-convex.h5"]) == 0


def test_a_dry_run_solves_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    out, _ = told(capsys, "compare", "lumpy", "--dry-run")
    assert [line.split()[1] for line in out.splitlines()[1:]] == [
        "pseudospectral",
        "bezier",
        "bezier_free_guides",
        "convex",
        "convex",
    ]
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    ("site", "key"),
    [
        ("facet:17", {"site_facet": 17}),
        ("90, 0", {"site_facet": 0}),
        ("0,12000,0:0,2,0", {"site_facet": None, "site_normal": [0.0, 1.0, 0.0]}),
    ],
)
def test_a_site_has_three_forms(capsys: pytest.CaptureFixture[str], site: str, key: dict[str, Any]) -> None:
    main("plan", ["bezier", "lumpy", "--site", site, "--json", "--quiet"])
    plan = json.loads(capsys.readouterr().out)
    if key["site_facet"] != 0:
        assert {name: plan[name] for name in key} == key
    else:
        assert np.degrees(np.arctan2(plan["site_m"][1], plan["site_m"][0])) == pytest.approx(90.0)


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["bezier"], ExitCode.USAGE, "no scenario; name one, or take one from a reach result"),
        (["bezier", "lumpy", "--site", "north"], ExitCode.USAGE, "--site: 'north' is no site"),
        (["bezier", "lumpy", "--site", "1,2", "--facet", "3"], ExitCode.USAGE, "--site and --facet both"),
        (["bezier", "lumpy", "--case", "x"], ExitCode.USAGE, "add --from-run"),
        (["bezier", "lumpy", "--from-run", "r.h5", "--facet", "1"], ExitCode.USAGE, "a scenario beside"),
        (["bezier", "--from-run", "r.h5"], ExitCode.USAGE, "--from-run needs a site"),
        (["bezier", "--from-run", "r.h5", "--facet", "1"], ExitCode.REFUSED, "r.h5: cannot be read"),
        (["bezier", "lumpy", "--site", "0,0,1:0,0,1"], ExitCode.REFUSED, "plan.site.position_m: lies"),
        (["bezier", "lumpy", "--site", "0,9e3,0:0,0,0"], ExitCode.REFUSED, "plan.site.normal: is zero"),
        (["bezier", "lumpy", "--facet", "1596"], ExitCode.REFUSED, "1596 is no facet of the shape"),
        (
            ["bezier", "lumpy", "--set", "plan.initial_state.position_km=[0, 0, 1]"],
            ExitCode.REFUSED,
            "m inside the body; start outside the surface",
        ),
        (["convex", "lumpy", "--bezier-degree", "5"], ExitCode.USAGE, "greater than or equal to 6"),
        (["bezier", "lumpy", "-o", "lumpy.yaml"], ExitCode.REFUSED, "did not write"),
    ],
)
def test_bad_input_is_one_message_and_its_code(
    capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, message: str
) -> None:
    out, err = told(capsys, *arguments, code=code)
    assert out == "" and "Traceback" not in err
    assert message in " ".join(err.split())
    assert not list(Path().glob("runs/*.h5"))


def test_a_scenario_without_the_section_is_refused_before_the_shape_is_read(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    text = SCENARIO.split("plan:")[0].replace("lumpy.obj", "missing.obj") + (
        "reach: {initial_states: [{name: a, position_km: [0, 0, 30]}], tof_s: 900, final_stage_s: 200}\n"
    )
    (tmp_path / "only.yaml").write_text(text)
    err = told(capsys, "bezier", "only", code=ExitCode.REFUSED)[1]
    assert "only.yaml: plan: the scenario has no such section; `plan` needs initial_state" in err


def test_a_sweep_tells_its_share_and_flies_every_plan_again(capsys: pytest.CaptureFixture[str]) -> None:
    found = as_json(capsys, "sweep", "lumpy", "--set", FAST_SWEEP)
    sweep = found["sweep"]
    assert sweep["initial_positions"] == 4
    assert sweep["verified"] == sweep["planned"] > 0
    assert sweep["planned"] + sum(sweep["refusals"].values()) == 4
    longitudes = [plan["longitude_deg"] for plan in found["plans"]]
    assert longitudes == [0, 90, 195, 270]


def test_jobs_and_backends_change_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    for jobs, backend, name in (("1", "threads", "a"), ("2", "threads", "b"), ("2", "loky", "c")):
        told(
            capsys,
            *("sweep", "lumpy", "--set", FAST_SWEEP, "-o", f"{name}.h5"),
            *("--jobs", jobs, "--backend", backend),
        )
    assert len({read(Path(f"{name}.h5")).digest for name in "abc"}) == 1


def test_a_stopped_run_is_resumed_to_the_same_result(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ("sweep", "lumpy", "--set", FAST_SWEEP, "--jobs", "1")
    told(capsys, *command, "-o", "whole.h5")
    solved: list[int] = []

    def stopping(tasks: Any, indices: Any, repeat: bool) -> Any:
        solved.extend(indices)
        if len(solved) > 2:
            raise KeyboardInterrupt
        return solve_tasks(tasks, indices, repeat)

    monkeypatch.setattr(pipeline, "solve_tasks", stopping)
    assert main("plan", [*command, "-o", "parts.h5"]) == ExitCode.SIGNAL + signal.SIGINT
    monkeypatch.setattr(pipeline, "solve_tasks", solve_tasks)
    capsys.readouterr()
    err = told(capsys, *command, "-o", "parts.h5", code=ExitCode.REFUSED)[1]
    assert "holds this run, unfinished (2 chunks are safe)" in err
    told(capsys, *command, "-o", "parts.h5", "--resume")
    whole, parts = (run_from_result(read(Path(f"{name}.h5"))) for name in ("whole", "parts"))
    assert digest(run_to_tree(whole)) == digest(run_to_tree(parts))


def test_results_commands_know_a_plan(capsys: pytest.CaptureFixture[str]) -> None:
    told(capsys, "bezier", "lumpy")
    run = "runs/lumpy-plan-bezier.h5"

    def results(*arguments: str, code: int = 0) -> tuple[str, str]:
        assert main("landing", ["results", *arguments]) == code
        return capsys.readouterr()

    assert results("show", run)[0].splitlines()[1].startswith("bezier_2000s")
    assert "verified" in results("verify", run)[0]
    csv = results("export", run)[0].splitlines()
    assert csv[0].startswith("t_s,position_m_x") and len(csv) == 2002
    assert results("export", run, "--table", "summary")[0].startswith("name,method,status,message,tof_s,")
    oem = results("export", run, "--format", "oem")[0]
    assert "REF_FRAME = LUMPY_FIXED" in oem and "2030-05-01T00:33:20.000000" in oem
    assert "has no facets table" in results("export", run, "--table", "facets", code=ExitCode.USAGE)[1]
    assert "has no map" in results("export", run, "--format", "obj", code=ExitCode.USAGE)[1]
    assert "has no facets; choose with --case" in results("show", run, "--facet", "1", code=ExitCode.USAGE)[1]
    assert "no plan 'x'" in results("show", run, "--case", "x", code=ExitCode.REFUSED)[1]
    told(capsys, "bezier", "lumpy", "-o", "other.h5", "--set", "plan.clearance_m=400")
    out, err = results("diff", run, "other.h5")
    assert "scenario: clearance_m: 300 -> clearance_m: 400" in err
    assert out.splitlines()[1].startswith("bezier_2000s")


def test_figures_are_drawn(capsys: pytest.CaptureFixture[str]) -> None:
    told(capsys, "bezier", "lumpy")
    told(capsys, "sweep", "lumpy", "--set", FAST_SWEEP)
    capsys.readouterr()
    assert main("landing", ["results", "plot", "runs/lumpy-plan-bezier.h5", "--out", "figures"]) == 0
    assert main("landing", ["results", "plot", "runs/lumpy-plan-sweep.h5", "--out", "figures"]) == 0
    names = [Path(line).name for line in capsys.readouterr().out.splitlines()]
    assert names == [
        "lumpy-plan-bezier-paths.png",
        "lumpy-plan-bezier-profiles.png",
        "lumpy-plan-bezier-bezier_2000s-histories.png",
        "lumpy-plan-bezier-bezier_2000s-orders.png",
        "lumpy-plan-sweep-initial-positions.png",
        "lumpy-plan-sweep-paths.png",
        "lumpy-plan-sweep-profiles.png",
    ]
    for name in names:
        assert Path("figures", name).read_bytes()[:4] == b"\x89PNG"

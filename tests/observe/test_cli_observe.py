"""plan observe on the command line: what is printed and stored, the exit codes, and resuming."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from observe_scenario_samples import SCENARIO, write_pebble

from landing_cli.cli.app import main
from landing_cli.errors import ExitCode
from landing_cli.observe import pipeline
from landing_cli.observe.stored import run_from_result, run_to_tree
from landing_cli.observe.tasks import solve_tasks
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
    "waypoints",
    "performance_index_m2_s3",
    "propellant_mass_fraction",
    "features_seen",
    "nominal",
)
ONE = ("--waypoints", "3")


@pytest.fixture(autouse=True)
def _inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_pebble(tmp_path)


def told(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> tuple[str, str]:
    assert main("plan", ["observe", *arguments]) == code, capsys.readouterr().err
    return capsys.readouterr()


def as_json(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> dict[str, Any]:
    return json.loads(told(capsys, *arguments, "--json", "--quiet", code=code)[0])


def results(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> tuple[str, str]:
    assert main("landing", ["results", *arguments]) == code
    return capsys.readouterr()


def test_a_run_prints_its_table_and_stores_its_result(capsys: pytest.CaptureFixture[str]) -> None:
    out, err = told(capsys, "pebble")
    lines = out.splitlines()
    assert lines[0].split()[:4] == ["name", "status", "tof_s", "performance_index_m2_s3"]
    assert [line.split()[:2] for line in lines[1:]] == [
        ["nominal", "planned"],
        ["waypoints_0", "planned"],
        ["waypoints_3", "planned"],
    ]
    assert err.splitlines()[0] == "read pebble.yaml"
    assert err.splitlines()[-1] == "wrote runs/pebble-plan-observe.h5"
    stored = read(Path("runs/pebble-plan-observe.h5"))
    assert stored.mission == "observe" and stored.complete


def test_json_has_the_fields_of_the_contract(capsys: pytest.CaptureFixture[str]) -> None:
    found = as_json(capsys, "pebble", *ONE)
    assert set(CONTRACT) <= set(found)
    assert found["method"] == "observe" and found["waypoints"] == 3
    assert set(found["features_seen"]) == {"distinct", "mean_in_view", "longest_gap_s"}
    same = ("performance_index_m2_s3", "propellant_mass_fraction", "features_seen", "fuel_kg", "status")
    assert set(same) <= set(found["nominal"])
    assert found["performance_index_m2_s3"] > found["nominal"]["performance_index_m2_s3"]
    assert found["observations"][0]["features_seen"] == found["features_seen"]
    burnt = 1.0 - np.exp(-found["delta_v_m_s"] / (220 * 9.80665))
    assert found["propellant_mass_fraction"] == pytest.approx(burnt, rel=1e-12)
    assert found["fuel_kg"] == pytest.approx(500 * burnt, rel=1e-12)
    several = as_json(capsys, "pebble", "-o", "two.h5")
    assert [one["waypoints"] for one in several["observations"]] == [0, 3]
    assert several["waypoints"] == 3  # the last one
    assert several["nominal"] == found["nominal"]


def test_information_stands_beside_the_waypoints(capsys: pytest.CaptureFixture[str]) -> None:
    told_ = as_json(capsys, "pebble", "--objective", "information")
    found = told_["observations"]
    assert told_["name"] == "information_0.1"
    assert [one["name"] for one in found] == ["information_0.1", "waypoints_0", "waypoints_3"]
    informed, least = found[0], found[1]
    assert informed["objective"] == "information" and informed["status"] == "planned"

    def cost(one: dict[str, Any]) -> float:
        ratio = one["performance_index_m2_s3"] / least["performance_index_m2_s3"]
        return ratio + 0.1 * np.log(one["position_sigma_m"]["mean"])

    assert cost(informed) < min(cost(one) for one in found[1:])
    ratio = informed["performance_index_m2_s3"] / least["performance_index_m2_s3"]
    assert informed["performance_index_ratio"] == pytest.approx(ratio, rel=1e-12)


def test_the_same_again_is_up_to_date_and_another_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    told(capsys, "pebble", *ONE)
    assert "is up to date" in told(capsys, "pebble", *ONE)[1]
    err = told(capsys, "pebble", "--waypoints", "3,1", code=ExitCode.REFUSED)[1]
    assert "waypoints: [3] -> waypoints: [3, 1]" in err
    told(capsys, "pebble", "--waypoints", "3,1", "--force")


def test_other_landmarks_in_the_same_file_are_another_run(capsys: pytest.CaptureFixture[str]) -> None:
    text = SCENARIO.replace(
        "synthetic: {seed: 3, clusters: 3, mean_per_cluster: 8, spread_m: 12, extent_m: 90}",
        "file: marks.csv",
    )
    Path("pebble.yaml").write_text(text)
    rows = ["lon_deg,lat_deg", "-3,40", "2,44", "5,37", "-9,46"]
    Path("marks.csv").write_text("\n".join(rows))
    found = as_json(capsys, "pebble", *ONE)
    assert found["landmarks"] == 4
    assert "is up to date" in told(capsys, "pebble", *ONE)[1]
    Path("marks.csv").write_text("\n".join(rows[:-1]))
    err = told(capsys, "pebble", *ONE, code=ExitCode.REFUSED)[1]
    assert "holds the result of a different run: scenario: sha256:" in err
    pinned = ("--set", f"observe.landmarks.sha256={64 * 'a'}", "-o", "b.h5")
    err = told(capsys, "pebble", *ONE, *pinned, code=ExitCode.REFUSED)[1]
    assert "observe.landmarks.sha256: marks.csv has the hash" in " ".join(err.split())


def test_a_dry_run_solves_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    out, _ = told(capsys, "pebble", "--dry-run", "--objective", "information")
    assert [line.split()[0] for line in out.splitlines()[1:]] == [
        "information_0.1",
        "waypoints_0",
        "waypoints_3",
    ]
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--waypoints", "three"], ExitCode.USAGE, "--waypoints: 'three' is no list of numbers"),
        (["--site", "north"], ExitCode.USAGE, "--site: 'north' is no site"),
        (["--waypoints", "3,3"], ExitCode.REFUSED, "waypoints.1: 3 is in the list twice"),
        (["--waypoints", "40"], ExitCode.REFUSED, "40 waypoints are too many for 60 intervals"),
        (["--site", "facet:9999"], ExitCode.REFUSED, "observe.site.facet: 9999 is no facet"),
        (
            ["--set", "observe.initial_state.site_position_m=[60, 0, -3]"],
            ExitCode.REFUSED,
            "observe.initial_state.site_position_m: lies 3 m below the plane of the site's facet",
        ),
        (
            ["--set", "observe.initial_state.site_position_m=[0, 0, 0]"],
            ExitCode.REFUSED,
            "is the landing site; start above it",
        ),
        (
            ["--set", "observe.landmarks={file: none.csv}"],
            ExitCode.REFUSED,
            "observe.landmarks.file: none.csv: cannot be read",
        ),
        (
            ["--set", "observe.steering.clusters=90"],
            ExitCode.REFUSED,
            "observe.steering.clusters: 90 clusters",
        ),
        (["--set", "observe.landmarks={}"], ExitCode.REFUSED, "give file or synthetic"),
        (["--set", "observe=null"], ExitCode.REFUSED, "is missing, and so are plan and observe"),
        (["-o", "pebble.yaml"], ExitCode.REFUSED, "did not write"),
    ],
)
def test_bad_input_is_one_message_and_its_code(
    capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, message: str
) -> None:
    out, err = told(capsys, "pebble", *arguments, code=code)
    assert out == "" and "Traceback" not in err
    assert message in " ".join(err.split())
    assert not list(Path().glob("runs/*"))


def test_a_start_below_the_facet_plane_of_a_tilted_frame_names_the_frame(
    capsys: pytest.CaptureFixture[str],
) -> None:
    tilted = ("--set", "observe.frame=radial", "--set", "observe.initial_state.site_position_m=[0, -400, 20]")
    err = told(capsys, "pebble", *tilted, code=ExitCode.REFUSED)[1]
    assert "deg off the facet's normal: see observe.frame" in " ".join(err.split())


def test_a_camera_that_sees_nothing_is_reported_with_the_reason(capsys: pytest.CaptureFixture[str]) -> None:
    blind = ("--set", "observe.sensor.range_max_m=0.5")
    found = as_json(capsys, "pebble", *ONE, *blind)
    assert found["features_seen"]["distinct"] == 0
    assert found["features_seen"]["longest_gap_s"] == 600.0
    assert "range" in found["unseen_because"]
    err = told(capsys, "pebble", *ONE, *blind)[1]
    assert "waypoints_3 sees no landmark: " in err
    assert results(capsys, "verify", "runs/pebble-plan-observe.h5")[0].count("verified") == 2


def test_without_light_a_camera_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    camera = "observe.sensor={kind: camera, half_field_of_view_deg: 50, angle_sigma_deg: 0.05, rate_hz: 0.1}"
    err = told(capsys, "pebble", *ONE, "--set", camera)[1]
    assert "illumination is off: the scenario says neither body.sun_direction nor body.orbit" in err
    lit = ("--set", camera, "--set", "body.sun_direction=[1, 0, 1]", "-o", "lit.h5")
    assert "illumination" not in told(capsys, "pebble", *ONE, *lit)[1]
    assert as_json(capsys, "pebble", *ONE, *lit)["illumination"] is True
    dark = ("--set", camera, "--set", "body.sun_direction=[-1, 0, -1]", "-o", "dark.h5")
    found = as_json(capsys, "pebble", *ONE, *dark)
    assert found["features_seen"]["distinct"] == 0 and found["not_seen_because"]["incidence"] > 0


def test_a_path_through_the_terrain_ends_with_4(capsys: pytest.CaptureFixture[str]) -> None:
    behind = ("--set", "observe.initial_state.site_position_m=[300, -300, 5]", "--waypoints", "0")
    deep = ("--set", "observe.initial_state.velocity_m_s=[0, 0, -1.5]")
    out, err = told(capsys, "pebble", *behind, *deep, code=ExitCode.NOTHING_FEASIBLE)
    assert "infeasible" in out
    assert "cuts the terrain" in err and "m deep" in err


def test_a_limit_that_cannot_be_kept_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    weak = ("--set", "spacecraft.thrust_max_n=0.05")
    found = as_json(capsys, "pebble", *ONE, *weak, code=ExitCode.NOTHING_FEASIBLE)
    assert found["status"] in ("infeasible", "unresolved") and found["message"]


def test_interpolated_gravity_lands_where_the_polyhedron_does(capsys: pytest.CaptureFixture[str]) -> None:
    exact = as_json(capsys, "pebble", *ONE, "--set", "observe.gravity=polyhedron")
    fitted = as_json(capsys, "pebble", *ONE, "--set", "observe.gravity=interpolated", "-o", "fitted.h5")
    assert fitted["gravity"] == "interpolated" and 0.0 < fitted["gravity_error_relative"] < 1e-3
    assert fitted["performance_index_m2_s3"] == pytest.approx(exact["performance_index_m2_s3"], rel=1e-4)
    assert results(capsys, "verify", "fitted.h5")[0].count("verified") == 2


def test_jobs_and_backends_change_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    for jobs, backend, name in (("1", "threads", "a"), ("2", "threads", "b"), ("2", "loky", "c")):
        told(capsys, "pebble", "-o", f"{name}.h5", "--jobs", jobs, "--backend", backend)
    assert len({read(Path(f"{name}.h5")).digest for name in "abc"}) == 1


def test_a_stopped_run_is_resumed_to_the_same_result(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ("pebble", "--waypoints", "0,1,3", "--jobs", "1")
    told(capsys, *command, "-o", "whole.h5")
    solved: list[int] = []

    def stopping(ground: Any, tasks: Any, indices: Any) -> Any:
        solved.extend(indices)
        if len(solved) > 2:
            raise KeyboardInterrupt
        return solve_tasks(ground, tasks, indices)

    monkeypatch.setattr(pipeline, "solve_tasks", stopping)
    assert main("plan", ["observe", *command, "-o", "parts.h5"]) == ExitCode.SIGNAL + signal.SIGINT
    monkeypatch.setattr(pipeline, "solve_tasks", solve_tasks)
    capsys.readouterr()
    err = told(capsys, *command, "-o", "parts.h5", code=ExitCode.REFUSED)[1]
    assert "holds this run, unfinished (2 chunks are safe)" in err
    told(capsys, *command, "-o", "parts.h5", "--resume")
    whole, parts = (run_from_result(read(Path(f"{name}.h5"))) for name in ("whole", "parts"))
    assert digest(run_to_tree(whole)) == digest(run_to_tree(parts))


def test_results_commands_know_an_observation(capsys: pytest.CaptureFixture[str]) -> None:
    told(capsys, "pebble")
    run = "runs/pebble-plan-observe.h5"
    assert results(capsys, "show", run)[0].splitlines()[2].startswith("waypoints_0")
    assert len(results(capsys, "show", run, "--case", "waypoints_3")[0].splitlines()) == 3
    verified = results(capsys, "verify", run)[0]
    assert verified.count("verified") == 3
    summary = results(capsys, "export", run)[0].splitlines()
    assert summary[0].startswith("name,method,objective,waypoints,status") and len(summary) == 3
    assert "nominal_features_seen_distinct" in summary[0]
    marks = results(capsys, "export", run, "--table", "landmarks")[0].splitlines()
    assert marks[0].startswith("name,position_m_x") and "in_view_waypoints_3" in marks[0]
    view = results(capsys, "export", run, "--table", "view", "--case", "waypoints_3")[0].splitlines()
    assert view[0] == "case,t_s,landmarks_in_view,position_sigma_m" and len(view) == 62
    path = results(capsys, "export", run, "--table", "trajectory", "--case", "waypoints_3")[0].splitlines()
    assert path[0].startswith("t_s,position_m_x")
    oem = results(capsys, "export", run, "--format", "oem", "--case", "waypoints_3")[0]
    assert "REF_FRAME = PEBBLE_FIXED" in oem and "2030-05-01T00:10:00.000000" in oem
    assert (
        "has no facets table" in results(capsys, "export", run, "--table", "facets", code=ExitCode.USAGE)[1]
    )
    assert "no observation 'x'" in results(capsys, "show", run, "--case", "x", code=ExitCode.REFUSED)[1]
    told(capsys, "pebble", "-o", "other.h5", "--set", "observe.steering.timing=velocity_matched")
    out, err = results(capsys, "diff", run, "other.h5")
    assert "timing: paper -> timing: velocity_matched" in err
    assert out.splitlines()[1].startswith("waypoints_0")


def test_figures_are_drawn_alike_every_time(capsys: pytest.CaptureFixture[str]) -> None:
    told(capsys, "pebble")
    run = "runs/pebble-plan-observe.h5"
    out = results(capsys, "plot", run, "--out", "figures")[0]
    names = [Path(line).name for line in out.splitlines()]
    stem = "pebble-plan-observe"
    assert names == [
        f"{stem}-{name}.png"
        for name in (
            "paths",
            "clusters",
            "waypoints_0-map",
            "waypoints_3-map",
            "sight",
            "thrust",
            "costs",
            "front",
        )
    ]
    results(capsys, "plot", run, "--out", "again")
    for name in names:
        drawn = Path("figures", name).read_bytes()
        assert drawn[:4] == b"\x89PNG" and drawn == Path("again", name).read_bytes()


def test_a_file_that_was_tampered_with_fails_or_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    told(capsys, "pebble", *ONE)
    with h5py.File("runs/pebble-plan-observe.h5", "r+") as file:
        file["cases/waypoints_3"].attrs["performance_index_m2_s3"] = 1.0
    err = results(capsys, "verify", "runs/pebble-plan-observe.h5", code=ExitCode.REFUSED)[1]
    assert "has no seal at its end" in err

"""reach isochrone and landing results on its studies: what is printed, written and refused."""

from __future__ import annotations

import csv
import io
import json
import types
from pathlib import Path

import numpy as np
import pytest
from isochrone_samples import made_up_samples
from scenario_samples import MINIMAL, write_minimal

from landing_cli.cli.app import main
from landing_cli.errors import ExitCode
from landing_cli.scenario.load import load
from landing_cli.studies.isochrone import pipeline, work

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_minimal(tmp_path)
    shared = types.SimpleNamespace(centroids_m=np.zeros((8, 3)))
    monkeypatch.setattr(pipeline, "survey", lambda case: shared)
    monkeypatch.setattr(pipeline, "are_compiled", lambda descent: True)
    for module in (pipeline, work):
        monkeypatch.setattr(module, "solve_items", made_up_samples)
    return tmp_path


@pytest.fixture
def result(folder: Path, capsys: Capture) -> Path:
    assert main("reach", ["isochrone", "probe", "--tof-s", "500:1000:50", "-q"]) == 0
    capsys.readouterr()
    return folder / "runs" / "probe-reach-isochrone.h5"


def exported(capsys: Capture, *arguments: str) -> list[dict[str, str]]:
    assert main("landing", ["results", "export", *arguments]) == 0
    return list(csv.DictReader(io.StringIO(capsys.readouterr().out)))


def test_it_prints_states_and_growth_and_says_where_the_result_is(folder: Path, capsys: Capture) -> None:
    assert main("reach", ["isochrone", "probe", "--tof-s", "500:1000:50"]) == 0
    out, err = capsys.readouterr()
    lines = [line.split() for line in out.splitlines()]
    assert lines[0][:7] == [
        "case", "facets", "reachable", "unreachable", "unresolved", "several", "lost_again"
    ]  # fmt: skip
    assert lines[1][:7] == ["top", "8", "7", "1", "0", "1", "1"]
    assert lines[2] == []
    assert lines[3] == ["tof_s", "top", "top_km2"]
    assert [line[:2] for line in lines[4:]] == [
        ["500", "1"], ["550", "3"], ["600", "5"], ["650", "7"], ["700", "7"], ["750", "6"],
        ["800", "6"], ["850", "7"], ["900", "7"], ["950", "6"], ["1000", "6"],
    ]  # fmt: skip
    assert err.splitlines()[0] == "read probe.yaml"
    assert err.splitlines()[-1] == "wrote runs/probe-reach-isochrone.h5"
    assert main("reach", ["isochrone", "probe", "--tof-s", "500:1000:50"]) == 0
    assert "is up to date" in capsys.readouterr().err


def test_json_holds_the_growth(result: Path, capsys: Capture) -> None:
    assert main("landing", ["results", "show", str(result), "--json", "-q"]) == 0
    value = json.loads(capsys.readouterr().out)
    (case,) = value["cases"]
    assert (case["case"], case["reachable"], case["several"]) == ("top", 7, 1)
    assert case["first_tof_s"]["min"] == 500.0
    assert [row["reachable"] for row in case["growth"]][:3] == [1, 3, 5]


def test_a_facet_is_told_in_a_sentence_with_its_intervals(result: Path, capsys: Capture) -> None:
    assert main("landing", ["results", "show", str(result), "--facet", "5", "-q"]) == 0
    told = capsys.readouterr().out.splitlines()[0]
    assert told.startswith("top: facet 5 is reachable from 610.5")
    assert told.count("(not at") == 3
    assert "1000 s or beyond (the range ends there: open)" in told
    assert "unreachable at 2 of the times asked in between, 2 of them proved" in told  # 750 and 800 s
    assert main("landing", ["results", "show", str(result), "--facet", "6", "-q"]) == 0
    told = capsys.readouterr().out
    assert "unresolved from 620.3" in told
    assert "in between" not in told
    assert main("landing", ["results", "show", str(result), "--facet", "7", "-q"]) == 0
    assert "not reachable at any of 11 times from 500 to 1000 s (proved)" in capsys.readouterr().out
    assert main("landing", ["results", "show", str(result), "--facet", "8"]) == ExitCode.REFUSED


@pytest.mark.parametrize("tof_s", ["500", "612", "705.3", "900", "1000"])
def test_the_domain_at_any_time_is_read_off_the_file(result: Path, capsys: Capture, tof_s: str) -> None:
    from isochrone_samples import made_up_verdict

    rows = exported(capsys, str(result), "--table", "domain", "--tof-s", tof_s)
    assert len(rows) == 8
    for row in rows:
        expected = made_up_verdict(0, int(row["facet"]), float(tof_s))
        assert row["verdict"] == expected.name.lower()
        on_grid = float(tof_s) % 50 == 0 and row["verdict"] == "reachable"
        assert (row["delta_v_m_s"] != "nan") == on_grid


def test_every_table_and_map_is_written(result: Path, capsys: Capture) -> None:
    intervals = exported(capsys, str(result), "--table", "intervals", "--case", "top")
    assert [row["verdict"] for row in intervals if row["facet"] == "6"] == ["unresolved", "reachable"]
    assert [row["begin"] for row in intervals if row["facet"] == "6"] == ["reached", "unresolved"]
    facets = exported(capsys, str(result))
    assert [row["intervals"] for row in facets] == ["1", "1", "1", "1", "1", "2", "1", "0"]
    assert len(exported(capsys, str(result), "--table", "growth")) == 11
    assert len(exported(capsys, str(result), "--table", "summary")) == 1
    for form, more in (("vtp", []), ("obj", ["--tof-s", "612"]), ("ply", ["--tof-s", "612"])):
        output = ["-o", f"map.{form}"]
        assert main("landing", ["results", "export", str(result), "--format", form, *more, *output]) == 0
    groups = [line for line in Path("map.obj").read_text().splitlines() if line.startswith("g ")]
    assert {"g reachable", "g unreachable"} <= set(groups)


def test_figures_are_drawn(result: Path, capsys: Capture) -> None:
    assert main("landing", ["results", "plot", str(result)]) == 0
    names = [Path(line).name for line in capsys.readouterr().out.splitlines()]
    stem = "probe-reach-isochrone"
    assert names == [f"{stem}-growth.png", f"{stem}-top-isochrones.png", f"{stem}-top-several.png"]
    assert main("landing", ["results", "plot", str(result), "--facet", "5"]) == 0
    assert all(path.stat().st_size > 5000 for path in result.parent.glob("*.png"))


def test_diff_counts_what_moved(result: Path, capsys: Capture) -> None:
    arguments = ["isochrone", "probe", "--tof-s", "550:1000:50", "-o", "b.h5", "-q"]
    assert main("reach", arguments) == 0
    capsys.readouterr()
    assert main("landing", ["results", "diff", str(result), "b.h5", "--json"]) == 0
    (case,) = json.loads(capsys.readouterr().out)["cases"]
    assert (case["gained"], case["lost"], case["later"]) == (0, 0, 3)  # known from 550 s only


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--table", "domain"], "a domain is of one time of flight"),
        (["--table", "facets", "--tof-s", "700"], "--tof-s does not go with the facets table"),
        (["--tof-s", "1001"], "does not cover this time of flight"),
        (["--table", "trajectory", "--facet", "1"], "has no trajectory table"),
        (["--format", "oem"], "has no trajectory table"),
        (["--table", "intervals", "--format", "vtp"], "vtp is a map of facets"),
    ],
)
def test_what_cannot_be_exported_is_told(
    result: Path, capsys: Capture, arguments: list[str], told: str
) -> None:
    assert main("landing", ["results", "export", str(result), *arguments]) in (
        ExitCode.USAGE,
        ExitCode.REFUSED,
    )
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(
    "tof_s", ["700", "700:", "a:b", "700:900:25:1", "700:nan:5", "900:700:25", "100:900:25"]
)
def test_a_range_that_is_none_is_refused(folder: Path, capsys: Capture, tof_s: str) -> None:
    code = main("reach", ["isochrone", "probe", "--tof-s", tof_s])
    assert code in (ExitCode.USAGE, ExitCode.REFUSED)
    err = capsys.readouterr().err
    assert "--tof-s" in err or "isochrone.tof_" in err
    assert not (folder / "runs").exists()


def test_a_range_backwards_is_told_by_the_option_that_was_typed(folder: Path, capsys: Capture) -> None:
    assert main("reach", ["isochrone", "probe", "--tof-s", "900:700:25"]) == ExitCode.USAGE
    assert "--tof-s: '900:700:25' ends before it begins" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("isochrone.tolerance_s=30", "is longer than step_s"),
        ("isochrone.tolerance_s=0.001", "more than 16384 times"),
        ("isochrone.tof_min_s=150", "not longer than reach.final_stage_s"),
        ("isochrone.step=5", "isochrone.step: is not a key here"),
        ("isochrone.tof_max_s=later", "isochrone.tof_max_s"),
    ],
)
def test_a_wrong_section_is_told_by_its_key(folder: Path, capsys: Capture, override: str, told: str) -> None:
    assert main("reach", ["isochrone", "probe", "--set", override]) == ExitCode.REFUSED
    assert told in capsys.readouterr().err


def test_a_dry_run_lists_the_times(folder: Path, capsys: Capture) -> None:
    before = sorted(folder.rglob("*"))
    assert main("reach", ["isochrone", "probe", "--dry-run", "--json"]) == 0
    (case,) = json.loads(capsys.readouterr().out)["cases"]
    assert case["tof_max_s"] == 900.0
    assert case["grid_solves"] == 8 * case["times"]
    assert sorted(folder.rglob("*")) == before


def test_nothing_reachable_is_exit_4(folder: Path) -> None:
    assert main("reach", ["isochrone", "probe", "--tof-s", "400:450:25", "-q"]) == ExitCode.NOTHING_FEASIBLE


def test_the_section_changes_no_other_result(tmp_path: Path) -> None:
    from landing_cli.scenario.sections import for_mission

    plain = load(str(write_minimal(tmp_path))).scenario
    text = f"{MINIMAL}isochrone: {{step_s: 10}}\n"
    told = load(str(write_minimal(tmp_path, text, "told.yaml"))).scenario
    assert for_mission(plain, "reach") == for_mission(told, "reach")
    assert for_mission(told, "reach", "isochrone").isochrone == told.isochrone

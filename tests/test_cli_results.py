"""landing results on made-up runs: what is printed, refused and compared."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.mesh import Mesh
from landing_cli.cli.app import main
from landing_cli.errors import ExitCode
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.records import FacetSolutions, LandingCase, Verdict, blank_rows
from landing_cli.reach.stored import CaseResult, ReachRun, run_to_tree
from landing_cli.results.identity import RunIdentity
from landing_cli.results.store import write

FACETS = 4
TETRAHEDRON = Mesh(
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) * 100.0,
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
)


def stored_run(
    path: Path,
    verdicts: list[Verdict],
    j: float = 2.0,
    tof_s: float = 700.0,
    known: dict[str, list[float]] | None = None,
) -> Path:
    """Write a run of one case with the given verdicts and columns."""
    rows = blank_rows(np.arange(FACETS))
    rows["verdict"] = verdicts
    for name, values in (known or {}).items():
        rows[name] = values
    rows["performance_index_m2_s3"][rows["verdict"] == Verdict.REACHABLE] = j
    case = LandingCase(
        f"top_{tof_s:g}s",
        Asteroid("rock", TETRAHEDRON, 1e-4, point_mass_field(1.0), 1.0),
        Spacecraft(1000.0, 10.0, 300.0),
        np.array([0, 0, 900.0]),
        np.zeros(3),
        tof_s,
        200.0,
        np.full(3, 200.0),
        1.0,
    )
    reachable = verdicts.count(Verdict.REACHABLE)
    summary = {
        "facets": FACETS,
        "reachable": reachable,
        "unreachable": verdicts.count(Verdict.UNREACHABLE),
        "unresolved": verdicts.count(Verdict.UNRESOLVED),
        "proved": 1,
        "paths_through_rock": 3,
        "reachable_area_m2": 5000.0 * reachable,
        "delta_v_m_s": {"min": 1.0, "median": 2.0, "max": None},
    }
    run = ReachRun((CaseResult(case, "top", FacetSolutions(rows, np.zeros((0, 3))), summary),))
    identity = RunIdentity("reach run", f"name: rock\nreach:\n  tof_s: [{tof_s:g}]\n", "ab" * 32, "0.1.0")
    attributes = {"mission": "reach", "complete": 1, **identity.as_dict()}
    write(path, run_to_tree(run), attributes, {"command_line": "reach run rock.yaml"})
    return path


YES, NO = Verdict.REACHABLE, Verdict.UNREACHABLE


def test_show_prints_the_table_of_cases(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = stored_run(tmp_path / "a.h5", [YES, YES, NO, NO])
    assert main("landing", ["results", "show", str(path)]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[1].split() == ["top_700s", "4", "2", "2", "1", "0", "10000", "1", "2", "-", "3"]
    assert "reach run, version 0.1.0, complete" in err
    assert "reach run rock.yaml" in err


def test_show_json_is_what_scripts_rely_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = stored_run(tmp_path / "a.h5", [YES, YES, NO, NO])
    assert main("landing", ["results", "show", str(path), "--json", "-q"]) == 0
    out, err = capsys.readouterr()
    value = json.loads(out)
    assert err == ""
    assert (value["run"], value["scenario"]) == (str(path), "rock")
    assert value["cases"] == [
        {
            "case": "top_700s",
            "initial_state": "top",
            "tof_s": 700.0,
            "facets": 4,
            "reachable": 2,
            "unreachable": 2,
            "unresolved": 0,
            "proved": 1,
            "paths_through_rock": 3,
            "reachable_area_m2": 10000.0,
            "delta_v_m_s": {"min": 1.0, "median": 2.0, "max": None},
        }
    ]


def test_diff_counts_facets_gained_and_lost(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old = stored_run(tmp_path / "a.h5", [YES, YES, NO, NO])
    new = stored_run(tmp_path / "b.h5", [YES, NO, YES, YES], j=2.2)
    assert main("landing", ["results", "diff", str(old), str(new), "--json"]) == 0
    value = json.loads(capsys.readouterr().out)
    assert value["equal"] is False
    case = value["cases"][0]
    assert (case["gained"], case["lost"], case["changed"]) == (2, 1, 3)
    assert case["j_change_max"] == pytest.approx(0.1)


def test_diff_says_when_results_are_equal_and_what_was_asked_differently(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old = stored_run(tmp_path / "a.h5", [YES, YES, NO, NO])
    new = stored_run(tmp_path / "b.h5", [YES, YES, NO, NO])
    assert main("landing", ["results", "diff", str(old), str(new)]) == 0
    assert "equal in every dataset and attribute" in capsys.readouterr().err
    other = stored_run(tmp_path / "c.h5", [YES, YES, NO, NO], tof_s=800.0)
    assert main("landing", ["results", "diff", str(old), str(other)]) == ExitCode.REFUSED
    err = capsys.readouterr().err
    assert "tof_s" in err
    assert "no case of the same name" in err


@pytest.mark.parametrize("content", [None, b"", b"\x89HDF\r\n\x1a\n", b"name: bennu\n"])
@pytest.mark.parametrize("command", ["show", "diff"])
def test_what_is_no_result_is_refused_by_name(
    command: str, content: bytes | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "x.h5"
    if content is not None:
        path.write_bytes(content)
    assert (
        main("landing", ["results", command, *[str(path)] * (2 if command == "diff" else 1)])
        == ExitCode.REFUSED
    )
    out, err = capsys.readouterr()
    assert out == ""
    assert "x.h5" in err
    assert "Traceback" not in err


def test_a_result_of_another_mission_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from landing_cli.results.tree import Group

    identity = RunIdentity("swim across", "name: x\n", "", "9.9.9")
    write(tmp_path / "t.h5", Group({}), {"mission": "swim", "complete": 1, **identity.as_dict()}, {})
    assert main("landing", ["results", "show", str(tmp_path / "t.h5")]) == ExitCode.REFUSED
    assert "holds a result of 'swim', which this version does not read" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("--format ply", "ply is binary"),
        ("--format vtp --table summary", "a map of facets, not of a summary"),
        ("--format oem --table facets", "an oem holds a trajectory, not the facets table"),
        ("--format oem", "name it with --facet"),
        ("--table trajectory", "name it with --facet"),
        ("--table summary --facet 1", "--facet does not go with the summary table"),
        ("--facet 1", "add --table trajectory"),
    ],
)
def test_an_export_that_makes_no_sense_is_a_mistake_of_usage(
    arguments: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = stored_run(tmp_path / "a.h5", [YES, YES, NO, NO])
    assert main("landing", ["results", "export", str(path), *arguments.split()]) == ExitCode.USAGE
    out, err = capsys.readouterr()
    assert out == ""
    assert told in err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("--table boundary", "this run traced no boundary"),
        ("--case top_800s", "take one of top_700s"),
        ("--table trajectory --facet 2", "no flight to it in top_700s: it is unreachable"),
        ("--table trajectory --facet 4", "take one of 0 to 3"),
        ("-o a.h5 --force", "is the result that is exported"),
        ("-o b.csv", "is there already"),
    ],
)
def test_an_export_that_cannot_be_is_refused(
    arguments: str,
    told: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    before = stored_run(tmp_path / "a.h5", [YES, YES, NO, NO]).read_bytes()
    (tmp_path / "b.csv").write_text("mine")
    assert main("landing", ["results", "export", "a.h5", *arguments.split()]) == ExitCode.REFUSED
    out, err = capsys.readouterr()
    assert out == ""
    assert told in err
    assert (tmp_path / "a.h5").read_bytes() == before
    assert (tmp_path / "b.csv").read_text() == "mine"


@pytest.mark.parametrize("form", ["csv", "json", "vtp", "obj"])
def test_text_goes_to_stdout_or_to_the_same_file(
    form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, target = stored_run(tmp_path / "a.h5", [YES, YES, NO, NO]), tmp_path / f"x.{form}"
    assert main("landing", ["results", "export", str(path), "--format", form]) == 0
    out, err = capsys.readouterr()
    assert (len(out) > 100, err) == (True, "")
    assert main("landing", ["results", "export", str(path), "--format", form, "-o", str(target)]) == 0
    assert capsys.readouterr() == ("", f"wrote {target}\n")
    assert target.read_text().rstrip("\n") == out.rstrip("\n")
    assert sorted(tmp_path.iterdir()) == [path, target]


def test_a_binary_map_goes_to_a_file(tmp_path: Path) -> None:
    path, target = stored_run(tmp_path / "a.h5", [YES, YES, NO, NO]), tmp_path / "x.ply"
    assert main("landing", ["results", "export", str(path), "--format", "ply", "-o", str(target)]) == 0
    assert target.read_bytes().startswith(b"ply\nformat binary_little_endian")


def told_about(capsys: pytest.CaptureFixture[str], path: Path, facet: int) -> str:
    assert main("landing", ["results", "show", str(path), "--facet", str(facet), "-q"]) == 0
    return capsys.readouterr().out.splitlines()[0]


def test_show_says_what_is_known_about_a_facet_and_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    known: dict[str, list[float]] = {
        "delta_v_m_s": [3.25, 3.25, np.nan, np.nan],
        "fuel_kg": [1.66, 1.66, np.nan, np.nan],
        "peak_thrust_ratio": [1.0, 0.5, np.nan, np.nan],
        "terrain_clearance_min_m": [30.0, -4.0, np.nan, np.nan],
        "binding": [3, 0, 1, 2],
        "proved": [0, 0, 1, 0],
        "violation": [0.0, 0.0, 0.042, 0.003],
        "thrust_margin": [np.nan, np.nan, np.nan, -0.003],
    }
    path = stored_run(tmp_path / "a.h5", [YES, YES, NO, NO], known=known)
    sentences = [
        "is reachable: 3.25 m/s, 1.66 kg, peak thrust 100 %; what binds: the glide slope",
        "is reachable: 3.25 m/s, 1.66 kg, peak thrust 50 %, but the path cuts 4 m into rock; "
        "what binds: nothing",
        "is unreachable (proved): it needs at least 104.2 % of the thrust",
        "is unreachable (not proved): it needs 100.3 % of the thrust to pass around the ellipsoid",
    ]
    for facet, sentence in enumerate(sentences):
        told = told_about(capsys, path, facet)
        known_part, _, helps = told.partition("; it would be reachable with ")
        assert known_part == f"top_700s: facet {facet} {sentence}"
        assert bool(helps) == (facet > 1)
    assert main("landing", ["results", "show", str(path), "--facet", "2", "--json", "-q"]) == 0
    (case,) = json.loads(capsys.readouterr().out)["cases"]
    assert (case["case"], case["verdict"], case["binding"]) == ("top_700s", "unreachable", "thrust")
    assert case["delta_v_m_s"] is None
    assert set(case["why_not"]) == {"thrust", "time", "glide_slope", "ellipsoid", "easiest"}
    assert set(case["why_not"]["time"]) == {"change_s", "step_s", "searched_from_s", "searched_to_s"}
    assert case["handover_position_m"] == [None, None, None]
    assert main("landing", ["results", "show", str(path), "--facet", "4"]) == ExitCode.REFUSED
    assert "--facet 4: no such facet; take one of 0 to 3" in capsys.readouterr().err


def test_show_says_that_a_facet_is_unresolved(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = stored_run(
        tmp_path / "a.h5", [YES, Verdict.UNRESOLVED, NO, NO], known={"violation": [0, 0.25, 1, 1]}
    )
    told = "unresolved: no search converged, the best attempt breaks a limit by 0.25 of its scale"
    assert told_about(capsys, path, 1).startswith(f"top_700s: facet 1 is {told}; it would be reachable with ")


def test_why_not_is_a_table_of_all_facets_that_are_not_reachable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = stored_run(tmp_path / "a.h5", [YES, Verdict.UNRESOLVED, NO, NO])
    command = ["results", "export", str(path), "--table", "why_not", "-q", "--jobs", "2"]
    assert main("landing", [*command, "--format", "json", "--case", "top_700s"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["facet"] for row in rows] == [1, 2, 3]
    assert [row["verdict"] for row in rows] == ["unresolved", "unreachable", "unreachable"]
    assert {row["easiest"] for row in rows} <= {"thrust", "time", "glide_slope", "ellipsoid"}
    for row in rows:
        assert row["more_propellant_kg"] is None
        assert row["depth_in_rock_m"] is None
        assert row["searched_more_thrust_n"] == 40.0
        assert row["searched_less_time_s"] == 375.0
        assert row["more_thrust_n"] is None or 0.0 < row["more_thrust_n"] <= 40.0
    assert main("landing", command) == 0
    assert capsys.readouterr().out.splitlines()[0].startswith("case,facet,verdict,proved,binding,easiest,")
    assert main("landing", [*command, "--format", "vtp"]) == ExitCode.USAGE
    assert "a map of facets, not of a why_not" in capsys.readouterr().err


def test_why_not_of_a_case_that_reaches_everything_is_an_empty_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = stored_run(tmp_path / "a.h5", [YES, YES, YES, YES])
    command = ["results", "export", str(path), "--table", "why_not", "--case", "top_700s", "-q"]
    assert main("landing", command) == 0
    (header,) = capsys.readouterr().out.splitlines()
    assert header.startswith("facet,verdict,proved,binding,easiest,more_thrust_n,")


def test_show_says_how_rock_stands_in_the_way(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    known: dict[str, list[float]] = {"violation": [0, 0.002, 0.031, 1], "binding": [0, 5, 5, 1]}
    known["thrust_margin"] = [np.nan, np.nan, -0.031, np.nan]
    path = stored_run(tmp_path / "a.h5", [YES, Verdict.UNRESOLVED, NO, NO], known=known)
    told = "unresolved: no flight clear of rock was found, the best cuts 5 m into it"  # a0 tp^2 is 2500 m
    assert told_about(capsys, path, 1).startswith(f"top_700s: facet 1 is {told}")
    told = "it needs 103.1 % of the thrust to pass clear of the rock, on the best way that was found"
    assert told_about(capsys, path, 2).startswith(f"top_700s: facet 2 is unreachable (not proved): {told}")

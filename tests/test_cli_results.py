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


def stored_run(path: Path, verdicts: list[Verdict], j: float = 2.0, tof_s: float = 700.0) -> Path:
    """Write a run of one case with the given verdicts."""
    rows = blank_rows(np.arange(FACETS))
    rows["verdict"] = verdicts
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

    identity = RunIdentity("tour search", "name: x\n", "", "9.9.9")
    write(tmp_path / "t.h5", Group({}), {"mission": "tour", "complete": 1, **identity.as_dict()}, {})
    assert main("landing", ["results", "show", str(tmp_path / "t.h5")]) == ExitCode.REFUSED
    assert "holds a result of 'tour', which this version does not read" in capsys.readouterr().err

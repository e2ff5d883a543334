"""Verification: flights with closed forms, honest runs pass, and every lie in a stored run is found."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from shape_helpers import fibonacci_ellipsoid

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.ellipsoid import least_volume_ellipsoid
from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.mesh import Mesh
from landing_cli.cli.app import main
from landing_cli.errors import ExitCode
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach import verify
from landing_cli.reach.extremal_descent import solve_from
from landing_cli.reach.free_descent import prepare, solve_prepared, survey
from landing_cli.reach.records import FacetSolutions, LandingCase, Verdict, blank_rows
from landing_cli.reach.reflight import measure_rows, survey_ground
from landing_cli.reach.stored import CaseResult, ReachRun, run_to_tree
from landing_cli.reach.summary import summarise
from landing_cli.reach.verify import verify_run
from landing_cli.results.identity import RunIdentity
from landing_cli.results.store import write

NAME = "top_700s"
ROCK = fibonacci_ellipsoid((280.0, 265.0, 250.0), 60)
READINGS = [
    pytest.param({}, id="free"),
    pytest.param({"final_stage_thrust": "paper"}, id="the paper's thrust"),
    pytest.param({"handover": "on_ellipsoid"}, id="handover on the ellipsoid"),
    pytest.param({"descent": "extremal"}, id="extremal"),
]


def rock_case(**changes: object) -> LandingCase:
    asteroid = Asteroid("rock", ROCK, 4.07e-4, point_mass_field(4.9), 4.9)
    facts = {
        "name": NAME,
        "asteroid": asteroid,
        "spacecraft": Spacecraft(2000.0, 20.0, 400.0, 40.0),
        "position_m": np.array([0.0, 0.0, 800.0]),
        "velocity_m_s": np.zeros(3),
        "tof_s": 700.0,
        "final_stage_s": 200.0,
        "ellipsoid_m": least_volume_ellipsoid(ROCK.vertices),
        "glide_slope_half_angle_rad": math.radians(60.0),
    }
    return LandingCase(**(facts | changes))  # type: ignore[arg-type]


def solved(case: LandingCase) -> CaseResult:
    prepared = prepare(case, survey(case))
    found = solve_prepared(prepared, np.arange(len(ROCK.faces)))
    solutions = found if case.descent == "free" else solve_from(prepared, found)
    return CaseResult(case, "top", solutions, summarise(ROCK, solutions))


@pytest.fixture(scope="module")
def honest() -> CaseResult:
    return solved(rock_case())


def stored(result: CaseResult, path: Path) -> str:
    identity = RunIdentity("reach run", "name: rock\nbody: {epoch_utc: 2030-05-01}\n", "ab" * 32, "0.1.0")
    attributes = {"mission": "reach", "complete": 1, **identity.as_dict()}
    write(path, run_to_tree(ReachRun((result,))), attributes, {"command_line": "reach run rock.yaml"})
    return str(path)


@pytest.mark.parametrize("reading", READINGS)
def test_what_the_solvers_store_flies_as_they_say(reading: dict[str, str]) -> None:
    result = solved(rock_case(**reading))
    reachable = int((result.solutions.rows["verdict"] == Verdict.REACHABLE).sum())
    (report,) = verify_run((result,))
    assert report.verified, report.reason
    assert 10 < report.flown == reachable < len(ROCK.faces)
    assert report.worst["touchdown_miss_m"].value < 1e-3
    assert report.worst["integrators_apart_m"].value < (1e-4 if "descent" in reading else 1e-6)
    assert report.polyhedron is not None
    assert 1e-3 < report.polyhedron.median_m <= report.polyhedron.worst_m < 5.0
    assert ("handover_off_ellipsoid" in report.worst) == ("handover" in reading)
    if "final_stage_thrust" in reading:  # the bound is not on what is flown
        assert report.worst["final_thrust_excess"].value < 2e-5 < report.final_thrust_ratio - 1.0


def test_the_command_prints_a_table_and_json_with_every_check(
    honest: CaseResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = stored(honest, tmp_path / "a.h5")
    assert main("landing", ["results", "verify", path, "-q"]) == ExitCode.OK
    assert capsys.readouterr().out.splitlines()[1].split()[-1] == "verified"
    assert main("landing", ["results", "verify", path, "--json", "--all", "-j", "2"]) == ExitCode.OK
    value = json.loads(capsys.readouterr().out)
    (case,) = value["cases"]
    assert value["verified"] is case["verified"] is True
    assert case["worst"]["touchdown_miss_m"]["limit"] == 0.05
    assert case["polyhedron"]["facets"] == case["flown"]
    assert main("landing", ["results", "verify", path, "--case", "x"]) == ExitCode.REFUSED


def test_an_exported_trajectory_leads_from_the_initial_state_to_the_facet(
    honest: CaseResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = honest.solutions.rows
    facet = int(rows["facet"][rows["verdict"] == Verdict.REACHABLE][5])
    export = ["results", "export", stored(honest, tmp_path / "a.h5"), "--facet", str(facet), "--format"]
    assert main("landing", [*export, "json", "--table", "trajectory"]) == ExitCode.OK
    samples = json.loads(capsys.readouterr().out)
    path = np.array([[sample[f"position_m_{axis}"] for axis in "xyz"] for sample in samples])
    assert (samples[0]["t_s"], samples[-1]["t_s"]) == (0.0, 700.0)
    assert_allclose(path[0], honest.case.position_m)
    assert_allclose(path[-1], ROCK.vertices[ROCK.faces[facet]].mean(axis=0), rtol=0, atol=1e-3)
    assert main("landing", [*export, "oem"]) == ExitCode.OK
    lines = capsys.readouterr().out.splitlines()
    assert "REF_FRAME = ROCK_FIXED" in lines
    states = [line.split() for line in lines if line.startswith("2030-05-01T00:")]
    assert len(states) == len(path)
    assert_allclose(np.array(states)[:, 1:4].astype(float) * 1e3, path, rtol=0, atol=1e-6)


def test_threads_change_no_number(honest: CaseResult) -> None:
    assert verify_run((honest,), jobs=1) == verify_run((honest,), jobs=2)


Lie = Callable[[CaseResult], CaseResult]


def in_column(name: str, change: Callable[[np.ndarray], object], verdict: Verdict = Verdict.REACHABLE) -> Lie:
    """Change a column of one facet of the given verdict."""

    def lie(result: CaseResult) -> CaseResult:
        rows = result.solutions.rows.copy()
        place = np.flatnonzero(rows["verdict"] == verdict)[3]
        rows[name][place] = change(rows[name][place])
        return dataclasses.replace(result, solutions=FacetSolutions(rows, result.solutions.thrust_nodes_n))

    return lie


def in_case(**changes: object) -> Lie:
    return lambda result: dataclasses.replace(result, case=dataclasses.replace(result.case, **changes))  # type: ignore[arg-type]


def a_node(result: CaseResult) -> CaseResult:
    nodes = result.solutions.thrust_nodes_n.copy()
    nodes[77] *= 0.98
    return dataclasses.replace(result, solutions=FacetSolutions(result.solutions.rows, nodes))


def a_missing_facet(result: CaseResult) -> CaseResult:
    rows, offsets = result.solutions.rows, result.solutions.node_offsets
    solutions = FacetSolutions(rows[:-1], result.solutions.thrust_nodes_n[: offsets[-2]])
    return dataclasses.replace(result, solutions=solutions)


def a_better_summary(result: CaseResult) -> CaseResult:
    return dataclasses.replace(
        result, summary={**result.summary, "reachable": result.summary["reachable"] + 1}
    )


LIES: dict[str, tuple[Lie, str]] = {
    "a thrust node": (a_node, "touchdown_miss_m"),
    "the handover": (in_column("handover_position_m", lambda r: r + 0.2), "_miss_m"),
    "the handover's velocity": (in_column("handover_velocity_m_s", lambda v: 1.01 * v), "touchdown_miss_m"),
    "J": (in_column("performance_index_m2_s3", lambda j: 1.0001 * j), "stored_performance_index"),
    "delta-v": (in_column("delta_v_m_s", lambda v: 1.001 * v), "stored_delta_v"),
    "fuel": (in_column("fuel_kg", lambda m: 0.999 * m), "stored_fuel"),
    "handover mass": (in_column("handover_mass_kg", lambda m: m + 0.1), "stored_handover_mass"),
    "a thrust ratio": (in_column("peak_thrust_ratio_final", lambda u: u - 1e-4), "stored_peak_thrust"),
    "the glide slope": (in_column("glide_slope_margin_deg", lambda a: a + 0.1), "stored_glide_slope"),
    "the ellipsoid": (in_column("ellipsoid_margin", lambda m: m + 0.01), "stored_ellipsoid"),
    "a reachable facet's verdict": (in_column("verdict", lambda v: 2), "is unreachable, but its violation"),
    "an unreachable facet's verdict": (
        in_column("verdict", lambda v: 1, Verdict.UNREACHABLE),
        "facet 8 is proved unreachable, but its verdict is another",
    ),
    "a violation": (in_column("violation", lambda v: 1e-3), "is reachable, but its violation is not 0"),
    "a verdict of no meaning": (in_column("verdict", lambda v: 9), "has a verdict of no meaning"),
    "a proof": (in_column("proved", lambda p: 1), "is proved unreachable, but"),
    "a column that is missing": (in_column("costates", lambda c: np.nan * c), "its costates is missing"),
    "a control that is missing": (in_column("handover_position_m", lambda r: np.nan * r), "its control is"),
    "a facet that is missing": (a_missing_facet, "1 facets are missing from the table"),
    "a facet that stands twice": (in_column("facet", lambda f: f - 1), "stands in the table twice"),
    "the summary": (a_better_summary, "the summary says reachable"),
    "less thrust on board": (
        in_case(spacecraft=Spacecraft(2000.0, 19.9, 400.0, 40.0)),
        "_thrust_excess",
    ),
    "less propellant on board": (
        in_case(spacecraft=Spacecraft(2000.0, 20.0, 400.0, 3.0)),
        "propellant_excess",
    ),
    "a narrower cone": (in_case(glide_slope_half_angle_rad=math.radians(59.0)), "glide_slope"),
    "a larger ellipsoid": (in_case(ellipsoid_m=np.full(3, 420.0)), "ellipsoid_depth"),
    "a handover on the ellipsoid": (in_case(handover="on_ellipsoid"), "handover_off_ellipsoid"),
}


@pytest.mark.parametrize("lie", LIES)
def test_a_lie_in_a_stored_run_is_found(
    lie: str, honest: CaseResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(verify, "DOP853_FACETS", 1)
    monkeypatch.setattr(verify, "POLYHEDRON_FACETS", 1)
    tell, told = LIES[lie]
    (report,) = verify_run((tell(honest),))
    assert not report.verified
    assert report.reason.startswith(f"{NAME}: ")
    assert told in report.reason


def test_a_failure_names_the_facet_and_exits_with_5(
    honest: CaseResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = stored(a_node(honest), tmp_path / "lie.h5")
    place = np.searchsorted(honest.solutions.node_offsets, 77, side="right") - 1
    facet = honest.solutions.rows["facet"][place]
    assert main("landing", ["results", "verify", path, "-q"]) == ExitCode.VERIFICATION_FAILED
    out, err = capsys.readouterr()
    assert out.splitlines()[1].split()[-1] == "FAILED"
    assert f"{NAME}: facet {facet}: touchdown_miss_m" in err
    assert "(1 of " in err


def test_a_changed_costate_is_found() -> None:
    result = solved(rock_case(descent="extremal"))
    rows = result.solutions.rows.copy()
    place = np.flatnonzero(rows["verdict"] == Verdict.REACHABLE)[0]
    rows["costates"][place, 3] *= 1.001
    lie = dataclasses.replace(result, solutions=FacetSolutions(rows, result.solutions.thrust_nodes_n))
    (report,) = verify_run((lie,))
    assert report.worst["touchdown_miss_m"].facet == rows["facet"][place]
    assert report.worst["touchdown_miss_m"].failing == 1
    assert not report.verified


# Without gravity, spin and mass flow every quantity of a flight has a closed form.
FLAT = Mesh(
    np.array([[-30.0, -30.0, 0.0], [60.0, -30.0, 0.0], [-30.0, 60.0, 0.0], [0.0, 0.0, -90.0]]),
    np.array([[0, 1, 2], [0, 2, 3], [2, 1, 3], [1, 0, 3]]),
)
START, PUSH, MASS, T1, T2 = np.array([150.0, 0.0, 400.0]), np.array([1.6, 0.0, 8.0]), 1000.0, 300.0, 100.0
EMPTY = GravityField(point_mass_field(1.0).kind, point_mass_field(1e-60).params)


def drifting_flight() -> tuple[LandingCase, FacetSolutions]:
    """Constant thrust for T1, which first falls towards an ellipsoid and past it; then the final arc."""
    case = LandingCase(
        "flat",
        Asteroid("flat", FLAT, 0.0, EMPTY, 1e-60),
        Spacecraft(MASS, 10.0, 1e12),
        START,
        np.array([-1.1, 0.0, -2.2]),
        T1 + T2,
        T2,
        np.array([90.0, 90.0, 120.0]),
        math.radians(80.0),
    )
    rows = blank_rows(np.array([0]))
    rows["thrust_nodes"] = 10
    a = PUSH / MASS
    rows["handover_position_m"] = START + T1 * case.velocity_m_s + 0.5 * T1**2 * a
    rows["handover_velocity_m_s"] = case.velocity_m_s + T1 * a
    return case, FacetSolutions(rows, np.tile(PUSH, (10, 1)))


def test_measures_of_a_flight_equal_their_closed_forms() -> None:
    case, solutions = drifting_flight()
    (flown,) = measure_rows(case, solutions, np.array([0]), survey_ground(FLAT))
    r = solutions.rows["handover_position_m"][0]
    v = solutions.rows["handover_velocity_m_s"][0]
    at_end, at_start = (6.0 * r + 2.0 * T2 * v) / T2**2, -(6.0 * r + 4.0 * T2 * v) / T2**2
    assert flown["touchdown_miss_m"] < 1e-9
    assert flown["touchdown_speed_m_s"] < 1e-11
    assert flown["handover_miss_m"] < 1e-9
    arc = T2 / 6.0 * (at_end @ at_end + at_end @ at_start + at_start @ at_start)
    assert_allclose(flown["performance_index_m2_s3"], 0.5 * T1 * (PUSH @ PUSH) / MASS**2 + arc, rtol=1e-10)
    assert_allclose(flown["peak_thrust_ratio_descent"], np.linalg.norm(PUSH) / 10.0, rtol=1e-12)
    largest = max(np.linalg.norm(at_end), np.linalg.norm(at_start))
    assert_allclose(flown["peak_thrust_ratio_final"], MASS * largest / 10.0, rtol=1e-9)
    angles = [math.degrees(math.atan2(math.hypot(*d[:2]), d[2])) for d in (r, at_end)]
    assert_allclose(flown["glide_slope_margin_deg"], 80.0 - max(angles), rtol=0, atol=1e-6)
    t = np.linspace(0.0, T1, 300_001)[:, None]
    path = START + t * case.velocity_m_s + 0.5 * t**2 * PUSH / MASS
    levels = ((path / case.ellipsoid_m) ** 2).sum(axis=1) - 1.0
    assert 0 < np.argmin(levels) < len(levels) - 1
    assert_allclose(flown["ellipsoid_margin"], levels.min(), rtol=0, atol=1e-5)


def test_delta_v_and_fuel_follow_the_rocket_equation() -> None:
    case, solutions = drifting_flight()
    craft = Spacecraft(MASS, 10.0, 300.0)
    case = dataclasses.replace(case, spacecraft=craft)
    (flown,) = measure_rows(case, solutions, np.array([0]), survey_ground(FLAT))
    used = T1 * np.linalg.norm(PUSH) / craft.exhaust_velocity_m_s
    assert_allclose(flown["handover_mass_kg"], MASS - used, rtol=1e-12)
    left = MASS - flown["fuel_kg"]
    assert_allclose(flown["delta_v_m_s"], craft.exhaust_velocity_m_s * math.log(MASS / left), rtol=1e-9)
    assert flown["touchdown_miss_m"] > 1e-3  # the handover without mass flow is not reached

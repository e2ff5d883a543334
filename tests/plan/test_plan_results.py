"""Plans on disk: the way there and back, the journal, and what a re-flight finds when they lie."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from planning_samples import lumpy_case
from test_acceleration_control import LEGS

from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.errors import InputRefused
from landing_cli.flight.legs import BezierLeg
from landing_cli.plan.assess import no_plan
from landing_cli.plan.bezier import plan_bezier
from landing_cli.plan.records import BezierOptions, Plan
from landing_cli.plan.stored import (
    CPU_ATTRIBUTE,
    PlanEntry,
    PlanRun,
    plan_from_arrays,
    plan_to_arrays,
    run_from_result,
    run_to_tree,
)
from landing_cli.plan.verify import fault_of, verify_entry, verify_run
from landing_cli.results.identity import RunIdentity
from landing_cli.results.store import read, write
from landing_cli.results.tree import digest

CASE = lumpy_case()


@pytest.fixture(scope="module")
def entry() -> PlanEntry:
    plan = plan_bezier(CASE, BezierOptions(coarse_points=9, fine_points=5))
    assert plan.status == "planned"
    return PlanEntry("bezier_2000s", CASE, plan, 0.01)


def with_control(plan: Plan, kind: str) -> Plan:
    return replace(plan, control=LEGS[kind], trajectory=None)


def same_plan(a: Plan, b: Plan) -> None:
    for name, value in vars(a).items():
        other = getattr(b, name)
        if name in ("control", "trajectory"):
            continue
        assert other == value or (value != value and other != other), name
    assert (a.trajectory is None) == (b.trajectory is None)
    if a.trajectory is not None:
        for name, values in vars(a.trajectory).items():
            np.testing.assert_array_equal(getattr(b.trajectory, name), values)
    assert [type(leg) for leg in a.control] == [type(leg) for leg in b.control]
    for leg, other in zip(a.control, b.control, strict=True):
        for name, values in vars(leg).items():
            if name != "gravity":
                np.testing.assert_array_equal(getattr(other, name), values)


@pytest.mark.parametrize("kind", LEGS)
@pytest.mark.parametrize("with_path", [True, False])
def test_a_plan_survives_the_journal(entry: PlanEntry, kind: str, with_path: bool) -> None:
    plan = replace(entry.plan, control=LEGS[kind])
    again, cpu_s = plan_from_arrays(plan_to_arrays(plan, 0.25, with_path), CASE.asteroid.gravity)
    same_plan(again, plan if with_path else replace(plan, trajectory=None))
    assert cpu_s == 0.25


def test_a_run_survives_its_file(entry: PlanEntry, tmp_path: Path) -> None:
    failed = PlanEntry("convex_2000s", CASE, no_plan(CASE, "convex", "unresolved", "no"), float("nan"))
    others = [replace(entry, name=kind, plan=with_control(entry.plan, kind)) for kind in LEGS]
    run = PlanRun((entry, failed, *others))
    tree = run_to_tree(run)
    identity = RunIdentity("plan bezier", "name: x\n", "0" * 64, "0.1")
    attributes = {"mission": "plan", **identity.as_dict(), "complete": 1}
    times = np.array([e.cpu_s for e in run.cases])
    write(tmp_path / "run.h5", tree, attributes, {CPU_ATTRIBUTE: times})
    again = run_from_result(read(tmp_path / "run.h5"))
    assert digest(run_to_tree(again)) == digest(tree)
    for ours, theirs in zip(run.cases, again.cases, strict=True):
        assert theirs.name == ours.name
        assert theirs.cpu_s == ours.cpu_s or np.isnan(ours.cpu_s)
        same_plan(theirs.plan, ours.plan)
    leg = again.cases[0].plan.control[0]
    assert isinstance(leg, BezierLeg)
    assert leg.gravity.kind == CASE.asteroid.gravity.kind


@pytest.mark.parametrize("change", ["status", "leg", "path", "no facts"])
def test_a_record_of_another_kind_is_refused(entry: PlanEntry, change: str) -> None:
    arrays = plan_to_arrays(entry.plan, 0.1, True)
    if change == "status":
        arrays["facts"] = np.frombuffer(
            arrays["facts"].tobytes().replace(b'"planned"', b'"perfect"'), dtype=np.uint8
        )
    elif change == "leg":
        arrays["leg0_points_m"] = np.zeros((8, 2))
    elif change == "path":
        arrays["path_velocity_m_s"] = arrays["path_velocity_m_s"][:5]
    else:
        del arrays["facts"]
    with pytest.raises(InputRefused):
        plan_from_arrays(arrays, CASE.asteroid.gravity)


@pytest.mark.parametrize("integrator", ["dop853", "gauss"])
def test_a_sound_plan_is_verified(entry: PlanEntry, integrator: Any) -> None:
    report = verify_entry(entry, integrator=integrator)
    assert report.verified and report.flown
    assert report.worst["touchdown_miss_m"].value < 1e-5
    assert report.worst["stored_path_m"].value < 1e-3


def moved(plan: Plan, by_m: float) -> Plan:
    leg = plan.control[0]
    assert isinstance(leg, BezierLeg)
    points = leg.points_m.copy()
    points[4, 1] += by_m
    return replace(plan, control=(replace(leg, points_m=points),))


@pytest.mark.parametrize(
    ("lie", "check"),
    [
        (lambda e: replace(e, plan=replace(e.plan, fuel_kg=e.plan.fuel_kg * 0.999)), "stored_fuel"),
        (lambda e: replace(e, plan=replace(e.plan, peak_thrust_n=20.0)), "stored_peak_thrust"),
        (lambda e: replace(e, plan=replace(e.plan, clearance_surface_m=900.0)), "stored_clearance_m"),
        (lambda e: replace(e, plan=replace(e.plan, cone_entry_s=900.0)), "stored_cone_entry"),
        (lambda e: replace(e, plan=moved(e.plan, 1.0)), "stored_path_m"),
        (lambda e: replace(e, case=replace(e.case, clearance_m=9e3)), "clearance_shortfall_m"),
        (
            lambda e: replace(
                e, case=replace(e.case, site=replace(e.case.site, position_m=e.case.site.position_m + 0.1))
            ),
            "touchdown_miss_m",
        ),
        (
            lambda e: replace(e, case=replace(e.case, landing_velocity_m_s=np.full(3, 0.01))),
            "touchdown_speed_m_s",
        ),
        (
            lambda e: replace(
                e, case=replace(e.case, spacecraft=replace(e.case.spacecraft, thrust_max_n=20.0))
            ),
            "thrust_excess",
        ),
        (
            lambda e: replace(
                e, case=replace(e.case, spacecraft=replace(e.case.spacecraft, propellant_kg=1.0))
            ),
            "propellant_excess_kg",
        ),
    ],
)
def test_a_lie_is_found(entry: PlanEntry, lie: Any, check: str) -> None:
    report = verify_entry(lie(entry))
    assert not report.verified
    assert report.worst[check].failing
    assert report.badness > 1.0 and report.case in report.reason


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"control": ()}, "has no control"),
        ({"status": "infeasible", "message": ""}, "does not say why"),
        ({"tof_s": 1999.0}, "its control lasts 2000 s"),
    ],
)
def test_a_record_that_contradicts_itself_is_a_fault(entry: PlanEntry, change: Any, words: str) -> None:
    broken = replace(entry, plan=replace(entry.plan, **change))
    if "tof_s" in change:
        broken = replace(broken, case=replace(CASE, tof_s=1999.0))
    assert words in fault_of(broken)
    assert verify_entry(broken).badness == np.inf


def test_a_refused_plan_is_not_flown(entry: PlanEntry) -> None:
    refused = replace(entry, plan=replace(entry.plan, status="infeasible", message="too weak"))
    report = verify_entry(refused)
    assert report.verified and not report.flown


def test_the_polyhedron_is_reported_and_fails_nothing(entry: PlanEntry) -> None:
    (report,) = verify_run((entry,))
    assert report.verified
    assert report.polyhedron_miss_m is not None and report.polyhedron_miss_m > 1.0
    mesh = CASE.asteroid.mesh
    field = polyhedron_field(mesh.vertices, mesh.faces, CASE.asteroid.gm_m3_s2)
    own = replace(CASE, asteroid=replace(CASE.asteroid, gravity=field))
    assert verify_entry(replace(entry, case=own), field).polyhedron_miss_m is None

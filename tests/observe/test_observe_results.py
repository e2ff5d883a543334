"""Observations on disk: the way there and back, the journal, and what a re-flight finds when they lie."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from observe_scenario_samples import write_pebble

from landing_cli.errors import InputRefused
from landing_cli.observe.observed import Clustering, ObservedPath
from landing_cli.observe.pipeline import ground_of, request_of
from landing_cli.observe.records import ObserveCase
from landing_cli.observe.stored import (
    CPU_ATTRIBUTE,
    ObservationEntry,
    ObserveRun,
    observation_from_arrays,
    observation_to_arrays,
    run_from_result,
    run_to_tree,
)
from landing_cli.observe.tasks import solve_task
from landing_cli.observe.verify import LIMITS, verify_path, verify_run
from landing_cli.results.identity import RunIdentity
from landing_cli.results.store import read, write
from landing_cli.results.tree import Dataset, Group, digest
from landing_cli.scenario.load import load


@pytest.fixture(scope="module")
def entries(tmp_path_factory: pytest.TempPathFactory) -> tuple[ObservationEntry, ...]:
    folder = tmp_path_factory.mktemp("pebble")
    loaded = load(
        str(write_pebble(folder)), ["observe.steering.waypoints=[0, 3]", "body.sun_direction=[1, 1, 1]"]
    )
    request = request_of(loaded)
    ground = ground_of(request)
    return tuple(
        ObservationEntry(task.name, ground.case, solve_task(ground, task), 0.25) for task in request.tasks
    )


def same(a: Any, b: Any, where: str = "") -> None:
    """Equal in every array and number of two records."""
    if hasattr(a, "__dataclass_fields__"):
        assert type(a) is type(b), where
        for name in a.__dataclass_fields__:
            if name not in ("surface", "asteroid"):
                same(getattr(a, name), getattr(b, name), f"{where}.{name}")
    elif isinstance(a, np.ndarray):
        np.testing.assert_array_equal(a, b, where)
        assert a.dtype == b.dtype, where
    else:
        assert a == b or (a != a and b != b), where


def test_an_observation_survives_the_journal(entries: tuple[ObservationEntry, ...]) -> None:
    for entry in entries:
        observation = entry.observation
        again, cpu_s = observation_from_arrays(
            observation_to_arrays(observation, 0.5), observation.nominal, observation.clustering
        )
        same(again, observation)
        assert cpu_s == 0.5


def stored(run: ObserveRun, path: Path) -> ObserveRun:
    identity = RunIdentity("plan observe", "name: x\n", "0" * 64, "0.1")
    attributes = {"mission": "observe", **identity.as_dict(), "complete": 1}
    write(path, run_to_tree(run), attributes, {CPU_ATTRIBUTE: np.array([e.cpu_s for e in run.cases])})
    return run_from_result(read(path))


def test_a_run_survives_its_file(entries: tuple[ObservationEntry, ...], tmp_path: Path) -> None:
    run = ObserveRun(entries)
    again = stored(run, tmp_path / "run.h5")
    assert digest(run_to_tree(again)) == digest(run_to_tree(run))
    for ours, theirs in zip(run.cases, again.cases, strict=True):
        same(theirs, ours)
        assert theirs.case.sun_direction is not None


def test_what_was_not_asked_is_none_again(entries: tuple[ObservationEntry, ...], tmp_path: Path) -> None:
    case = entries[0].case
    for changes in (
        {"clearance_m": 3.0, "glide_slope_half_angle_rad": 0.5, "sun_direction": None},
        {"tof_s": float("nan"), "time_of_flight": "search"},
    ):
        changed = tuple(replace(entry, case=replace(case, **changes)) for entry in entries)
        again = stored(ObserveRun(changed), tmp_path / "run.h5")
        same(again.cases[0].case, changed[0].case)


def with_part(group: Group, path: str, change: Any) -> Group:
    """The tree with one dataset or attribute changed; None takes it away."""
    head, _, rest = path.partition("/")
    members, attributes = dict(group.members), dict(group.attributes)
    if rest:
        members[head] = with_part(group.group(head), rest, change)
    elif head in members:
        if change is None:
            del members[head]
        else:
            old = group.dataset(head)
            members[head] = Dataset(change(old.data), old.units, old.description, old.dims)
    elif change is None:
        del attributes[head]
    else:
        attributes[head] = change(attributes[head])
    return Group(members, attributes)


@pytest.mark.parametrize(
    ("path", "change"),
    [
        ("nominal", None),
        ("clusters", None),
        ("asked/landmarks/facet", lambda x: x + 10**6),
        ("asked/landmarks/normal", lambda x: x * np.nan),
        ("asked/frame_x", lambda x: 2.0 * x),
        ("asked/site_facet", lambda _: -5),
        ("asked/frame", lambda _: "sideways"),
        ("asked/time_of_flight", lambda _: "soon"),
        ("asked/sensor/kind", lambda _: "ear"),
        ("asked/sensor/rate_hz", lambda _: 0.0),
        ("asked/prior/position_sigma_m", lambda _: -1.0),
        ("asked/sun_direction", lambda x: 2.0 * x),
        ("clusters/label", lambda x: x + 100),
        ("clusters/steered_to", lambda _: "up"),
        ("clusters/center_m", lambda x: x * np.inf),
        ("cases/waypoints_3/status", lambda _: "perfect"),
        ("cases/waypoints_3/objective", lambda _: "fame"),
        ("cases/waypoints_3/parameters", lambda _: "[]"),
        ("cases/waypoints_3/parameters", lambda _: "{"),
        ("cases/waypoints_3/path/t_s", lambda x: x[::-1]),
        ("cases/waypoints_3/path/t_s", lambda x: x + 1.0),
        ("cases/waypoints_3/path/acceleration_m_s2", lambda x: x.astype(np.float32)),
        ("cases/waypoints_3/path/velocity_m_s", None),
        ("cases/waypoints_3/seen/visible", lambda x: x[:, :-1]),
        ("cases/waypoints_3/seen/visible", lambda x: x + 2),
        ("cases/waypoints_3/waypoints/timing", lambda _: "late"),
        ("cases/waypoints_3/order", lambda _: "first"),
    ],
)
def test_a_file_with_a_wrong_part_is_refused(
    entries: tuple[ObservationEntry, ...], tmp_path: Path, path: str, change: Any
) -> None:
    tree = with_part(run_to_tree(ObserveRun(entries)), path, change)
    identity = RunIdentity("plan observe", "name: x\n", "0" * 64, "0.1")
    write(tmp_path / "run.h5", tree, {"mission": "observe", **identity.as_dict(), "complete": 1}, {})
    with pytest.raises(InputRefused, match=r"run\.h5: lacks a part or holds a wrong one"):
        run_from_result(read(tmp_path / "run.h5"))


@pytest.mark.parametrize("change", ["status", "path", "visible", "timing", "no facts", "no text"])
def test_a_record_of_another_kind_is_refused(entries: tuple[ObservationEntry, ...], change: str) -> None:
    observation = entries[1].observation
    arrays = observation_to_arrays(observation, 0.1)
    facts = json.loads(arrays["facts"].tobytes())
    if change == "status":
        facts["status"] = "perfect"
    elif change == "timing":
        facts["timing"] = "late"
    elif change == "path":
        arrays["path_position_m"] = arrays["path_position_m"][:5]
    elif change == "visible":
        arrays["seen_visible"] = arrays["seen_visible"].astype(np.float64)
    arrays["facts"] = np.frombuffer(json.dumps(facts).encode(), dtype=np.uint8)
    if change == "no facts":
        del arrays["facts"]
    elif change == "no text":
        arrays["facts"] = np.frombuffer(b"[1]", dtype=np.uint8)
    with pytest.raises(InputRefused, match="a journal record is not of this version"):
        observation_from_arrays(arrays, observation.nominal, observation.clustering)


def test_sound_paths_are_verified(entries: tuple[ObservationEntry, ...]) -> None:
    reports = verify_run(entries)
    assert [report.case for report in reports] == ["nominal", "waypoints_0", "waypoints_3"]
    for report in reports:
        assert report.verified and report.flown and report.badness < 1.0, report.reason
        assert report.worst["touchdown_miss_m"].value < 1e-6
        assert report.polyhedron_miss_m is not None and report.polyhedron_miss_m > 1e-3
    assert reports[2].worst["waypoint_miss_m"].value < 1e-6


def lying(observed: ObservedPath, **changes: Any) -> ObservedPath:
    return replace(observed, path=replace(observed.path, **changes))


def moved(values: np.ndarray, by: float) -> np.ndarray:
    changed = values.copy()
    changed[len(values) // 2, 0] += by
    return changed


def of_path(name: str, change: Any) -> Any:
    return lambda c, o, w: (c, lying(o, **{name: change(getattr(o.path, name))}), w)


def of_case(**changes: Any) -> Any:
    return lambda c, o, w: (replace(c, **changes), o, w)


def with_less_thrust(c: Any, o: Any, w: Any) -> Any:
    return replace(c, spacecraft=replace(c.spacecraft, thrust_max_n=0.01)), o, w


def with_other_sight(c: Any, o: Any, w: Any) -> Any:
    return c, replace(o, seen=replace(o.seen, visible=~o.seen.visible)), w


def with_less_doubt(c: Any, o: Any, w: Any) -> Any:
    return c, replace(o, sigma=replace(o.sigma, position_sigma_m=0.9 * o.sigma.position_sigma_m)), w


def with_other_waypoints(c: Any, o: Any, w: Any) -> Any:
    return c, o, replace(w, position_m=moved(w.position_m, 1e-2))


LIES: list[tuple[Any, str]] = [
    (of_path("performance_index_m2_s3", lambda x: x * (1 + 1e-6)), "stored_performance_index"),
    (of_path("delta_v_m_s", lambda x: 0.999 * x), "stored_delta_v"),
    (of_path("propellant_mass_fraction", lambda x: 1.1 * x), "stored_propellant_mass_fraction"),
    (of_path("peak_thrust_n", lambda x: 0.9 * x), "stored_peak_thrust"),
    (of_path("clearance_min_m", lambda x: x + 0.1), "stored_clearance_m"),
    (of_path("position_m", lambda x: moved(x, 1e-2)), "stored_path_m"),
    (of_path("acceleration_m_s2", lambda x: moved(x, 1e-5)), "touchdown_miss_m"),
    (of_path("acceleration_m_s2", lambda x: moved(x, 1e-5)), "touchdown_speed_m_s"),
    (with_other_waypoints, "waypoint_miss_m"),
    (of_case(clearance_m=80.0), "clearance_shortfall_m"),
    (of_case(glide_slope_half_angle_rad=0.2), "glide_slope_excess_rad"),
    (with_less_thrust, "thrust_excess"),
    (with_other_sight, "stored_visible"),
    (with_less_doubt, "stored_position_sigma"),
]


@pytest.mark.parametrize(("lie", "check"), LIES, ids=[check for _, check in LIES])
def test_a_lie_is_found(entries: tuple[ObservationEntry, ...], lie: Any, check: str) -> None:
    observation = entries[1].observation
    case, observed, waypoints = lie(entries[1].case, observation.steered, observation.waypoints)
    report = verify_path(case, "waypoints_3", observed, waypoints)
    assert not report.verified and report.worst[check].failing
    assert report.badness > 1.0 and report.reason.startswith("waypoints_3: ")


def test_every_limit_has_its_lie() -> None:
    assert {check for _, check in LIES} | {"depth_m"} == set(LIMITS)


def test_a_path_through_the_rock_is_found(entries: tuple[ObservationEntry, ...]) -> None:
    entry = entries[0]
    sunk = replace(entry.case.frame, origin_m=entry.case.frame.origin_m * 0.5)
    report = verify_path(replace(entry.case, frame=sunk), "m", entry.observation.steered)
    assert report.worst["touchdown_miss_m"].failing


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"status": "infeasible", "message": ""}, "does not say why"),
        ({"t_s": None}, "its time of flight is 600 s"),
    ],
)
def test_a_record_that_contradicts_itself_is_a_fault(
    entries: tuple[ObservationEntry, ...], change: dict[str, Any], words: str
) -> None:
    observed = entries[0].observation.steered
    if "t_s" in change:
        change = {"t_s": observed.path.t_s * 1.01}
    report = verify_path(entries[0].case, "m", lying(observed, **change))
    assert words in report.reason and report.badness == np.inf and not report.flown


def test_an_infeasible_path_is_flown_but_not_held_to_the_limits(
    entries: tuple[ObservationEntry, ...],
) -> None:
    entry = entries[0]
    case: ObserveCase = replace(entry.case, clearance_m=80.0)
    report = verify_path(case, "m", lying(entry.observation.steered, status="infeasible", message="too near"))
    assert report.verified and report.flown and "clearance_shortfall_m" not in report.worst


def test_clusters_are_of_the_runs_own_landmarks(entries: tuple[ObservationEntry, ...]) -> None:
    clustering: Clustering = entries[0].observation.clustering
    assert len(clustering.label) == len(entries[0].case.landmarks.position_m)

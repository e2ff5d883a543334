"""The observe section of a scenario: keys, contradictions, frames, light, and what the mesh refuses."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from observe_scenario_samples import write_pebble

from landing_cli.body.gravity.field import GravityKind
from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.errors import InputRefused
from landing_cli.observe.cases import observe_case, sun_of
from landing_cli.observe.landmark_source import with_landmarks_hash
from landing_cli.observe.pipeline import steering_of, tasks_of
from landing_cli.observe.records import InformationOptions, ObserveCase, SteeringOptions
from landing_cli.scenario.build import build
from landing_cli.scenario.load import load
from landing_cli.scenario.schema_observe import ObserveSection
from landing_cli.scenario.sections import for_mission, observe_section
from landing_cli.scenario.show import to_yaml


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pebble")
    write_pebble(path)
    return path


def case_of(folder: Path, *overrides: str) -> ObserveCase:
    loaded = with_landmarks_hash(load(str(folder / "pebble.yaml"), overrides))
    built = build(loaded)
    return observe_case(loaded, built.asteroid, built.spacecraft)


def refusal(folder: Path, *overrides: str) -> str:
    with pytest.raises(InputRefused) as caught:
        case_of(folder, *overrides)
    return str(caught.value)


def test_the_defaults_are_those_of_the_methods(folder: Path) -> None:
    section = observe_section(
        load(str(folder / "pebble.yaml"), ["observe.steering={}", "observe.information={}"])
    )
    (way,) = steering_of(section)
    assert way == SteeringOptions()
    assert section.information.knots == InformationOptions().knots
    assert asdict(way).keys() == section.steering.model_dump().keys()


def test_the_ways_to_steer_are_those_that_are_asked_for(folder: Path) -> None:
    changes = ["observe.steering.waypoints=[7, 0]", "observe.information.weight=[0.3, 1]"]
    section = observe_section(load(str(folder / "pebble.yaml"), changes))
    assert [task.name for task in tasks_of(section)] == ["waypoints_7", "waypoints_0"]
    informed = section.model_copy(update={"objective": "information"})
    names = [task.name for task in tasks_of(informed)]
    assert names == ["information_0.3", "information_1", "waypoints_7", "waypoints_0"]


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("observe.initial_state={}", "site_position_m: is missing; give site_position_m or position_m"),
        (
            "observe.initial_state={site_position_m: [0, 0, 9], position_m: [0, 0, 9]}",
            "position_m: stands beside site_position_m",
        ),
        ("observe.initial_state.site_position_m=[1e10, 0, 9]", "is more than a million km from the body"),
        ("observe.initial_state.velocity_m_s=[1e5, 0, 9]", "is faster than 10 km/s"),
        ("observe.initial_state={position_m: [0, 0, 10]}", "m below the plane of the site's facet"),
        ("observe.tof_s=soon", "observe.tof_s: 'soon' is not allowed; allowed: t_go, search"),
        ("observe.tof_s=0", "observe.tof_s: 0 is not more than 0"),
        ("observe.tof_search_s=[90, 60]", "observe.tof_search_s: ends before it begins"),
        ("observe.frame=tilted", "observe.frame: 'tilted' is not allowed"),
        ("observe.landmarks={file: a.csv, synthetic: {seed: 1}}", "synthetic: stands beside file"),
        ("observe.landmarks.sha256=" + 64 * "a", "sha256: belongs to a file"),
        ("observe.sensor.kind=camera", "range_sigma_m: belongs to a lidar"),
        ("observe.sensor.range_sigma_m=null", "range_sigma_m: is missing; a lidar measures range"),
        ("observe.sensor.range_max_m=0", "range_max_m: 0 is not more than 0"),
        ("observe.sensor.range_min_m=600", "range_max_m: 500 is not more than range_min_m"),
        ("observe.sensor.half_field_of_view_deg=90", "half_field_of_view_deg: 90 is not less than 90"),
        ("observe.steering.waypoints=[1, 1]", "observe.steering.waypoints.1: 1 is in the list twice"),
        ("observe.steering.waypoints=[-1]", "observe.steering.waypoints.0: -1 is not at least 0"),
        (
            "observe.steering={control_points_m: [[1, 2]], side: left}",
            "side: stands beside control_points_m, which replaces it",
        ),
        ("observe.steering.control_points_m=[[1, 2, 3]]", "control_points_m.0: has 3 elements"),
        ("observe.information.weight=[0.1, 1e-1]", "weight.1: 0.1 is in the list twice"),
        ("body.sun_direction=[0, 0, 0]", "body.sun_direction: is zero"),
        (
            "body.orbit={semi_major_axis_au: 1.4, eccentricity: 0.2, inclination_deg: 10,"
            " ascending_node_deg: 1, perihelion_argument_deg: 2, mean_anomaly_deg: 3, "
            "epoch_utc: 2030-01-01T00:00:00}",
            "body.pole: is missing; orbit needs it",
        ),
    ],
)
def test_what_is_wrong_is_told_with_its_key(folder: Path, override: str, message: str) -> None:
    assert message in refusal(folder, override)


@pytest.mark.parametrize("kind", ["radial", "normal"])
def test_start_and_velocity_are_given_in_the_site_frame_or_the_body_frame(folder: Path, kind: str) -> None:
    frame = f"observe.frame={kind}"
    case = case_of(folder, frame, "observe.initial_state.velocity_m_s=[0.1, -0.2, 0.3]")
    np.testing.assert_allclose(case.frame.to_site(case.position_m), [-60, 70, 90], rtol=1e-12)
    np.testing.assert_allclose(case.frame.axes @ case.velocity_m_s, [0.1, -0.2, 0.3], rtol=1e-12)
    z = case.frame.origin_m / np.linalg.norm(case.frame.origin_m) if kind == "radial" else case.frame.normal
    np.testing.assert_allclose(case.frame.axes[2], z, atol=1e-15)
    np.testing.assert_allclose(case.frame.axes @ case.frame.axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(case.frame.axes) == pytest.approx(1.0)
    position, velocity = case.position_m.tolist(), case.velocity_m_s.tolist()
    again = case_of(
        folder, frame, f"observe.initial_state={{position_m: {position}, velocity_m_s: {velocity}}}"
    )
    np.testing.assert_array_equal(again.position_m, case.position_m)
    np.testing.assert_array_equal(again.velocity_m_s, case.velocity_m_s)


def test_a_facet_is_landed_on_at_its_centroid(folder: Path) -> None:
    case = case_of(folder, "observe.site={facet: 17}", "observe.initial_state.site_position_m=[0, 0, 50]")
    np.testing.assert_array_equal(case.frame.origin_m, facet_centroids(case.asteroid.mesh)[17])
    np.testing.assert_array_equal(case.frame.normal, facet_normals(case.asteroid.mesh)[17])


def test_angles_and_times_reach_the_case_in_si(folder: Path) -> None:
    limits = ("observe.clearance_m=2", "observe.glide_slope_half_angle_deg=60")
    case = case_of(folder, *limits)
    assert case.sensor.half_field_of_view_rad == pytest.approx(math.radians(50.0), rel=1e-15)
    assert case.glide_slope_half_angle_rad == pytest.approx(math.radians(60.0), rel=1e-15)
    assert (case.time_of_flight, case.tof_s, case.clearance_m) == ("fixed", 600.0, 2.0)
    searched = case_of(folder, "observe.tof_s=search", "observe.tof_search_s=[100, 900]")
    assert (searched.time_of_flight, searched.tof_range_s) == ("search", (100.0, 900.0))
    assert math.isnan(searched.tof_s)


@pytest.mark.parametrize("gravity", ["body", "polyhedron", "interpolated"])
def test_the_field_is_the_bodys_or_the_polyhedrons(folder: Path, gravity: str) -> None:
    kind = case_of(folder, f"observe.gravity={gravity}").asteroid.gravity.kind
    assert kind is (GravityKind.POINT_MASS if gravity == "body" else GravityKind.POLYHEDRON)


def test_the_sun_is_given_or_follows_from_the_orbit(folder: Path) -> None:
    """A circular orbit in the ecliptic, seen by a body whose pole is the ecliptic's: the sun is opposite."""
    path = str(folder / "pebble.yaml")
    assert sun_of(load(path).scenario.body) is None
    given = sun_of(load(path, ["body.sun_direction=[0, 3, 4]"]).scenario.body)
    np.testing.assert_allclose(given, [0.0, 0.6, 0.8], rtol=1e-15)
    orbit = (
        "body.orbit={semi_major_axis_au: 1, eccentricity: 0, inclination_deg: 0, ascending_node_deg: 0,"
        " perihelion_argument_deg: 0, mean_anomaly_deg: %g, epoch_utc: 2030-05-01T00:00:00}"
    )
    pole = "body.pole={ra_deg: 270, dec_deg: 66.56071}"
    first = sun_of(load(path, [orbit % 30.0, pole]).scenario.body)
    later = sun_of(load(path, [orbit % 100.0, pole]).scenario.body)
    assert first is not None and later is not None
    np.testing.assert_allclose([first[2], later[2]], 0.0, atol=1e-4)
    turned = math.degrees(math.atan2(later[1], later[0]) - math.atan2(first[1], first[0])) % 360
    assert turned == pytest.approx(70.0, abs=1e-3)
    spun = sun_of(
        load(path, [orbit % 30.0, "body.pole={ra_deg: 270, dec_deg: 66.56071, w0_deg: 25}"]).scenario.body
    )
    back = math.degrees(math.atan2(spun[1], spun[0]) - math.atan2(first[1], first[0])) % 360
    assert back == pytest.approx(335.0, abs=1e-9)


def test_a_listed_field_is_read_beside_the_scenario(folder: Path) -> None:
    (folder / "marks.csv").write_text("name,lon_deg,lat_deg,diameter_m\nfirst,0,41,2.5\n,3,44,\n")
    case = case_of(folder, "observe.landmarks={file: marks.csv}")
    assert case.landmarks.name[0] == "first" and len(case.landmarks.name) == 2
    assert case.landmarks.diameter_m[0] == 2.5 and math.isnan(case.landmarks.diameter_m[1])
    (folder / "none.csv").write_text("lon_deg,lat_deg\n")
    assert "none.csv" in refusal(folder, "observe.landmarks={file: none.csv}")


def test_sections_of_other_missions_change_nothing(folder: Path) -> None:
    path = str(folder / "pebble.yaml")
    own = load(path).scenario
    both = load(
        path,
        ["reach={initial_states: [{name: a, position_km: [0, 0, 3]}], tof_s: 900, final_stage_s: 200}"],
    ).scenario
    assert to_yaml(for_mission(both, "observe")) == to_yaml(own)


def test_the_yaml_shows_every_key_of_the_section(folder: Path) -> None:
    scenario = load(str(folder / "pebble.yaml")).scenario
    text = to_yaml(scenario)
    for section in (ObserveSection, *(f.annotation for f in ObserveSection.model_fields.values())):
        for key in getattr(section, "model_fields", {}):
            assert f"{key}:" in text, key
    (folder / "again.yaml").write_text(text)
    assert load(str(folder / "again.yaml")).scenario == scenario


@pytest.mark.parametrize("name", ["eros", "published/shen2026-eros"])
def test_the_shipped_scenarios_have_landmarks_in_three_clusters(
    project_root: Path, reference_data: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    from landing_cli.observe.pipeline import ground_of, request_of

    monkeypatch.setenv("LANDING_REFERENCE_DATA", str(reference_data))
    ground = ground_of(request_of(load(str(project_root / "configs" / f"{name}.yaml"))))
    assert ground.nominal.path.status == "planned"
    assert len(ground.clustering.center_m) == 3 and ground.clustering.chosen_by == "elbow"
    if name != "eros":
        np.testing.assert_allclose(ground.clustering.control_points_m, ground.control_points_m, atol=1e-3)

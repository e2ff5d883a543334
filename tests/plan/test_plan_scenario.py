"""The plan section of a scenario: keys, contradictions, sites, and what the mesh refuses."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from plan_scenario_samples import SCENARIO, write_lumpy
from planning_samples import lumpy_mesh
from scenario_samples import write_minimal

from landing_cli.body.clearance import signed_distances
from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.body.outermost import outermost_point
from landing_cli.errors import InputRefused
from landing_cli.flight.dynamics import natural_acceleration
from landing_cli.plan.cases import AUTO_CLEARANCE, plan_cases
from landing_cli.plan.records import (
    BezierOptions,
    ConvexOptions,
    FreeGuidesOptions,
    PlanCase,
    PseudospectralOptions,
)
from landing_cli.scenario.build import build
from landing_cli.scenario.load import load
from landing_cli.scenario.schema_plan import PlanSection
from landing_cli.scenario.sections import for_mission, plan_section, reach_section
from landing_cli.scenario.show import to_yaml


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("lumpy")
    write_lumpy(path)
    return path


def cases(folder: Path, *overrides: str) -> tuple[PlanCase, ...]:
    loaded = load(str(folder / "lumpy.yaml"), overrides)
    built = build(loaded)
    return plan_cases(loaded, built.asteroid, built.spacecraft)


def refusal(folder: Path, *overrides: str) -> str:
    with pytest.raises(InputRefused) as caught:
        cases(folder, *overrides)
    return str(caught.value)


def test_the_defaults_are_those_of_the_methods(folder: Path) -> None:
    section = plan_section(load(str(folder / "lumpy.yaml"), ["plan.bezier={}"]))
    for own, options in (
        (section.bezier, BezierOptions()),
        (section.free_guides, FreeGuidesOptions()),
        (section.convex, ConvexOptions()),
        (section.pseudospectral, PseudospectralOptions()),
    ):
        assert own.model_dump() == asdict(options)


def test_a_scenario_may_have_either_section_or_both_but_not_none(folder: Path, tmp_path: Path) -> None:
    planned = load(str(folder / "lumpy.yaml"))
    with pytest.raises(
        InputRefused, match=r"lumpy.yaml: reach: the scenario has no such section; `reach run`"
    ):
        reach_section(planned)
    reached = load(str(write_minimal(tmp_path)))
    with pytest.raises(
        InputRefused, match=r"probe.yaml: plan: the scenario has no such section; `plan` needs"
    ):
        plan_section(reached)
    with pytest.raises(InputRefused, match=r"reach: is missing, and so are plan and observe"):
        load(str(folder / "lumpy.yaml"), ["plan=null"])


def test_the_section_of_another_mission_changes_nothing(folder: Path) -> None:
    scenario = load(str(folder / "lumpy.yaml")).scenario
    both = load(
        str(folder / "lumpy.yaml"),
        ["reach={initial_states: [{name: a, position_km: [0, 0, 30]}], tof_s: 900, final_stage_s: 200}"],
    ).scenario
    assert to_yaml(for_mission(both, "plan")) == to_yaml(scenario)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("plan.site={}", "plan.site.facet: is missing; give facet, lon_lat_deg, or position_m and normal"),
        ("plan.site={facet: 3, lon_lat_deg: [1, 2]}", "plan.site.lon_lat_deg: stands beside facet"),
        ("plan.site={position_m: [0, 9e3, 0]}", "plan.site.normal: is missing; position_m needs it"),
        ("plan.site={facet: 3, normal: [0, 0, 1]}", "plan.site.normal: stands beside facet"),
        ("plan.site={position_m: [0, 9e3, 0], normal: [0, 0, 0]}", "plan.site.normal: is zero"),
        ("plan.site={facet: 99999}", "plan.site.facet: 99999 is no facet of the shape; they are 0 to 1595"),
        ("plan.site={lon_lat_deg: [0, 91]}", "plan.site.lon_lat_deg.1: 91 is not at most 90"),
        ("plan.site={position_m: [0, 10, 0], normal: [0, 1, 0]}", "plan.site.position_m: lies"),
        ("plan.initial_state={position_m: [0, 0, 10]}", "plan.initial_state.position_m: lies"),
        ("plan.initial_state={position_m: [1e12, 0, 0]}", "is more than a million km"),
        ("plan.initial_state={}", "position_km: is missing; give position_km or position_m"),
        ("plan.tof_s=[2000, 2e3]", "plan.tof_s.1: 2000 is in the list twice"),
        ("plan.tof_s=-1", "plan.tof_s.0: -1 is not more than 0"),
        ("plan.cone_half_angle_deg=90", "plan.cone_half_angle_deg: 90 is not less than 90"),
        ("plan.clearance_m=-3", "plan.clearance_m: -3 is not at least 0"),
        ("plan.clearance=mesh", "plan.clearance: 'mesh' is not allowed"),
        ("plan.bezier.grid=3", "plan.bezier.grid: is not a key here"),
        ("plan.convex.terminal=soft", "plan.convex.terminal: 'soft' is not allowed"),
    ],
)
def test_what_is_wrong_is_told_with_its_key(folder: Path, override: str, message: str) -> None:
    assert message in refusal(folder, override)


def test_a_start_at_the_apex_of_the_cone_is_refused(folder: Path) -> None:
    site = cases(folder)[0].site.position_m
    told = refusal(folder, f"plan.initial_state={{position_m: {site.tolist()}}}")
    assert "is the landing site, the apex of the safety cone; start above it" in told


def test_a_normal_that_points_into_the_body_is_refused(folder: Path) -> None:
    site = cases(folder)[0].site
    free = f"plan.site={{position_m: {site.position_m.tolist()}, normal: {(-site.normal).tolist()}}}"
    assert "plan.site.normal: points into the body; the facet there faces" in refusal(folder, free)


def test_a_facet_lands_on_its_centroid_along_its_normal(folder: Path) -> None:
    mesh = cases(folder)[0].asteroid.mesh
    site = cases(folder, "plan.site={facet: 700}")[0].site
    np.testing.assert_array_equal(site.position_m, facet_centroids(mesh)[700])
    np.testing.assert_array_equal(site.normal, facet_normals(mesh)[700])
    assert site.facet == 700


@pytest.mark.parametrize("lon_lat", [(90, 0), (-33, 60), (180, -5)])
def test_longitude_and_latitude_land_on_the_surface_in_that_direction(folder: Path, lon_lat) -> None:
    case = cases(folder, f"plan.site={{lon_lat_deg: {list(lon_lat)}}}")[0]
    x, y, z = case.site.position_m
    assert np.degrees(np.arctan2(y, x)) % 360 == pytest.approx(lon_lat[0] % 360, abs=1e-9)
    assert np.degrees(np.arcsin(z / np.linalg.norm((x, y, z)))) == pytest.approx(lon_lat[1], abs=1e-9)
    assert abs(signed_distances(case.surface, case.site.position_m[None])[0]) < 1e-6
    np.testing.assert_allclose(case.site.normal, facet_normals(case.asteroid.mesh)[case.site.facet])


def test_the_outermost_of_several_surfaces_along_a_ray_is_taken() -> None:
    mesh = lumpy_mesh()
    shifted = type(mesh)(mesh.vertices + np.array([30000.0, 0.0, 0.0]), mesh.faces)  # the origin lies outside
    point, facet = outermost_point(shifted, [1.0, 0.0, 0.0])
    assert point[0] > 30000.0 + 10000.0
    assert facet_normals(shifted)[facet][0] > 0.0
    assert outermost_point(shifted, [-1.0, 0.0, 0.0]) is None


def test_a_given_normal_is_made_a_unit_vector(folder: Path) -> None:
    site = cases(folder, "plan.site={position_m: [0, 9e3, 0], normal: [0, 5, 0]}")[0].site
    np.testing.assert_array_equal(site.normal, [0.0, 1.0, 0.0])
    assert site.facet == -1


def test_auto_clearance_is_a_share_of_the_bodys_length(folder: Path) -> None:
    case = cases(folder, "plan.clearance_m=auto")[0]
    assert case.clearance_m == pytest.approx(AUTO_CLEARANCE * np.ptp(case.asteroid.mesh.vertices[:, 0]))


def test_the_initial_acceleration_is_that_of_coasting_unless_given(folder: Path) -> None:
    case = cases(folder)[0]
    field = case.asteroid.gravity
    expected = natural_acceleration(
        field.kind,
        field.params,
        case.asteroid.rotation_rate_rad_s,
        *case.position_m.tolist(),
        *case.velocity_m_s.tolist(),
    )
    np.testing.assert_allclose(case.acceleration_m_s2, expected, rtol=1e-15)
    given = cases(folder, "plan.initial_state.acceleration_m_s2=[1e-4, 0, 0]")[0]
    np.testing.assert_array_equal(given.acceleration_m_s2, [1e-4, 0.0, 0.0])


def test_a_time_of_flight_makes_a_case(folder: Path) -> None:
    assert [case.name for case in cases(folder, "plan.tof_s=[1800, 2000.5]")] == ["1800s", "2000.5s"]


def test_the_yaml_shows_every_key_of_the_section(folder: Path) -> None:
    text = to_yaml(load(str(folder / "lumpy.yaml")).scenario)
    for section in (PlanSection, *(f.annotation for f in PlanSection.model_fields.values())):
        for key in getattr(section, "model_fields", {}):
            assert f"{key}:" in text, key
    assert SCENARIO.splitlines()[0] in text

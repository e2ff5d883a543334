"""From scenario to bodies: units, origins, gravity, and what the mesh contradicts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenario_samples import MINIMAL, OCTAHEDRON, SHIPPED, write_minimal

from landing_cli.body.gravity.dipole import dipole_field
from landing_cli.body.gravity.field import GravityKind
from landing_cli.body.gravity.field_values import accelerations
from landing_cli.body.mass_properties import mass_properties
from landing_cli.errors import InputRefused
from landing_cli.scenario.build import Built, build, builder_over, read_surface
from landing_cli.scenario.init import scenario_text
from landing_cli.scenario.load import load

GM_OCTAHEDRON = 6.6743e-11 * 2000 * (4 / 3 * 300 * 250 * 200)


def built(folder: Path, *overrides: str) -> Built:
    return build(load(str(write_minimal(folder)), overrides))


def test_density_and_shape_make_the_gravitational_parameter(tmp_path: Path) -> None:
    asteroid = built(tmp_path).asteroid
    np.testing.assert_allclose(asteroid.gm_m3_s2, GM_OCTAHEDRON, rtol=1e-12, atol=0)
    assert asteroid.gravity.kind is GravityKind.POINT_MASS
    np.testing.assert_allclose(asteroid.rotation_rate_rad_s, 2 * np.pi / 18000, rtol=1e-12, atol=0)


def test_the_length_unit_scales_the_mesh(tmp_path: Path) -> None:
    path = write_minimal(tmp_path)
    shape = tmp_path / "octahedron.obj"
    in_m = build(load(str(path))).asteroid.mesh.vertices
    shape.write_text(OCTAHEDRON.replace("00", "00e-3").replace("50", "50e-3"))
    in_km = build(load(str(path), ["body.length_unit=km"])).asteroid.mesh.vertices
    np.testing.assert_allclose(in_km, in_m, rtol=1e-12, atol=0)


def test_the_body_is_moved_to_its_centre_of_mass_unless_told_otherwise(tmp_path: Path) -> None:
    path = write_minimal(tmp_path)
    shape = tmp_path / "octahedron.obj"
    shape.write_text(shape.read_text().replace("v 300 ", "v 320 "))
    moved = build(load(str(path))).asteroid.mesh
    np.testing.assert_allclose(mass_properties(moved).center_of_mass_m, 0, atol=1e-9)
    left = build(load(str(path), ["body.origin=file"])).asteroid.mesh
    assert left.vertices[0, 0] == 320


@pytest.mark.parametrize("model", ["point_mass", "harmonics", "dipole", "polyhedron", "interpolated"])
def test_every_gravity_model_is_built(tmp_path: Path, model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))  # where a fit is kept
    field = built(tmp_path, f"body.gravity={{model: {model}, gm_m3_s2: 2.7}}").asteroid.gravity
    assert field.kind.name == model.upper()
    assert np.isfinite(field.params).all()


def test_a_fitted_field_follows_the_scenarios_mass(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    points = np.array([[400.0, 100.0, 50.0], [160.0, 30.0, 20.0], [0.0, 0.0, 900.0]])
    for gm in (2.7, 3.1):
        fitted, exact = (
            built(tmp_path, f"body.gravity={{model: {model}, gm_m3_s2: {gm}}}").asteroid.gravity
            for model in ("interpolated", "polyhedron")
        )
        exact_g = accelerations(exact, points)
        np.testing.assert_allclose(
            accelerations(fitted, points), exact_g, rtol=0, atol=1e-6 * np.abs(exact_g).max()
        )


def test_given_coefficients_replace_those_of_the_mesh(tmp_path: Path) -> None:
    given = built(
        tmp_path, "body.gravity={model: harmonics, gm_m3_s2: 2.7, reference_radius_m: 100, c20: -0.5}"
    ).asteroid.gravity
    np.testing.assert_allclose(given.params[3], 2.7 * 100**2 * -0.5, rtol=1e-12, atol=0)  # Q_zz
    dipole = built(
        tmp_path, "body.gravity={model: dipole, gm_m3_s2: 2.7, mass_fraction: 0.25, separation_m: 80}"
    ).asteroid.gravity
    np.testing.assert_array_equal(dipole.params, dipole_field(2.7, 0.25, 80.0).params)


def test_the_ellipsoid_holds_every_vertex_and_given_ones_are_kept(tmp_path: Path) -> None:
    automatic = built(tmp_path)
    levels = ((automatic.asteroid.mesh.vertices / automatic.ellipsoid_m) ** 2).sum(axis=1)
    assert levels.max() <= 1.0
    np.testing.assert_array_equal(
        built(tmp_path, "reach.ellipsoid_m=[310, 305, 300]").ellipsoid_m, [310, 305, 300]
    )


def test_an_ellipsoid_may_leave_rock_outside_where_the_terrain_itself_is_in_the_way(tmp_path: Path) -> None:
    smaller = built(tmp_path, "reach.ellipsoid_m=[300, 250, 190]", "reach.terrain=require").ellipsoid_m
    np.testing.assert_array_equal(smaller, [300, 250, 190])


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (
            ["reach.ellipsoid_m=[300, 250, 190]"],
            "reach.ellipsoid_m: leaves 2 of the shape's 6 vertices outside",
        ),
        (
            ["reach.ellipsoid_m=[300, 250, 190]", "reach.terrain=require", "reach.descent=extremal"],
            "reach.ellipsoid_m: leaves 2 of the shape's 6 vertices outside",
        ),
        (
            ["reach.ellipsoid_m=[300, 250, 100]", "reach.terrain=require"],
            "reach.ellipsoid_m: is smaller than 0.7 of the least ellipsoid that holds the body",
        ),
        (["reach.initial_states.0.position_m=[0, 0, 200]"], "initial_states.0.position_m: top begins inside"),
        (["reach.initial_states.0.position_m=[0, 0, 0]"], "it is the centre"),
        (["body.shape=octahedro.obj"], "body.shape: "),
        (["body.length_unit=km"], "body.shape: "),
        (
            ["body.gravity={model: point_mass, gm_m3_s2: 4e9}"],
            "body.gravity.gm_m3_s2: 4e+09 and the shape's volume",
        ),
    ],
)
def test_what_the_mesh_contradicts_is_refused_by_key(
    tmp_path: Path, overrides: list[str], message: str
) -> None:
    with pytest.raises(InputRefused) as caught:
        built(tmp_path, *overrides)
    assert message in str(caught.value)


def test_a_start_inside_the_ellipsoid_names_the_line_and_a_height_that_works(tmp_path: Path) -> None:
    path = write_minimal(tmp_path, MINIMAL.replace("[0, 0, 900]", "[0, 0, 190]"))
    with pytest.raises(InputRefused, match=r"probe\.yaml:10: .*start higher: multiply it by (\S+)") as caught:
        build(load(str(path)))
    factor = float(str(caught.value).rsplit(" ", 1)[1])
    build(load(str(path), [f"reach.initial_states.0.position_m=[0, 0, {190 * factor}]"]))


def test_the_ellipsoid_that_a_refusal_names_is_accepted(tmp_path: Path) -> None:
    with pytest.raises(InputRefused) as caught:
        built(tmp_path, "reach.ellipsoid_m=[300, 250, 190]")
    enough = str(caught.value).rpartition("at least ")[2]
    built(tmp_path, f"reach.ellipsoid_m={enough}")


@pytest.mark.parametrize(("name", "facets"), [("bennu", 2692), ("bacchus", 4092), ("eros", 7790)])
def test_a_shipped_scenario_builds_on_its_shipped_shape(name: str, facets: int) -> None:
    result = build(load(name))
    assert len(result.asteroid.mesh.faces) == facets
    acceleration = result.spacecraft.thrust_max_n / result.spacecraft.mass_kg
    weight = result.asteroid.gm_m3_s2 / result.ellipsoid_m.min() ** 2
    assert acceleration > 3 * weight


@pytest.mark.parametrize(
    "path", [p for p in SHIPPED if p.stem.startswith("zhao2022")], ids=lambda path: path.stem
)
def test_a_replica_builds_on_the_reference_mesh(
    path: Path, reference_data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LANDING_REFERENCE_DATA", str(reference_data))
    result = build(load(str(path)))
    expected = {"zhao2022-bennu": [289.9, 279.4, 266.1], "zhao2022-bacchus": [605.2, 287.4, 337.0]}
    np.testing.assert_allclose(result.ellipsoid_m, expected[path.stem], rtol=3e-4, atol=0)


@pytest.mark.parametrize("shape", ["bennu.obj", "bacchus.obj", "eros.obj"])
def test_a_first_scenario_of_any_body_builds(shape: str, tmp_path: Path) -> None:
    path = tmp_path / "first.yaml"
    path.write_text(scenario_text("first", shape, "km", 2000.0, 6.0, tmp_path))
    loaded = load(str(path))
    result = build(loaded)
    assert len(loaded.scenario.reach.cases()) == 6
    weight = result.asteroid.gm_m3_s2 / result.ellipsoid_m.min() ** 2
    assert result.spacecraft.thrust_max_n / result.spacecraft.mass_kg >= 10 * weight


def test_an_ellipsoid_is_held_to_the_terrain_of_each_scenario_over_one_surface(tmp_path: Path) -> None:
    """What one scenario may ask for, as it requires clear flights, another over the same surface may not."""
    path = write_minimal(tmp_path)
    smaller = ["reach.ellipsoid_m=[300, 250, 190]", "reach.terrain=require"]
    build_one = builder_over(read_surface(load(str(path), smaller)))
    build_one(load(str(path), smaller))
    with pytest.raises(InputRefused, match=r"reach\.ellipsoid_m: leaves 2 of the shape"):
        build_one(load(str(path), smaller[:1]))

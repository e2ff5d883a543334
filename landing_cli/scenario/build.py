"""From a checked scenario to bodies and spacecraft, with the checks that need the mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.ellipsoid import least_volume_ellipsoid
from landing_cli.body.gravity.coefficients import degree2_from_mesh, dipole_from_mesh
from landing_cli.body.gravity.dipole import dipole_field
from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.harmonics import harmonics_field
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.body.gravity.scaled_field import scaled_field
from landing_cli.body.mass_properties import centred, mass_properties
from landing_cli.body.mesh import FloatArray, Mesh
from landing_cli.errors import InputRefused
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.scenario.constants import GRAVITATIONAL_CONSTANT
from landing_cli.scenario.load import LoadedScenario
from landing_cli.scenario.messages import KeyPath, Problem, dotted, refusal
from landing_cli.scenario.schema import Reach, Scenario
from landing_cli.scenario.schema_body import (
    AnyGravity,
    Body,
    DipoleGravity,
    HarmonicsGravity,
    InterpolatedGravity,
    PointMassGravity,
)
from landing_cli.sources.kept_interpolation import kept_interpolation
from landing_cli.sources.shape_files import read_shape
from landing_cli.sources.shape_search import find_shape

# Of the semi-axes that hold the body: gravity models may have their masses not far inside.
SMALLEST_SHARE = 0.7
LIGHTEST_KG_M3, HEAVIEST_KG_M3 = 10.0, 20_000.0
FITTING = "fitting a field to the polyhedron (once for a shape; about a minute)"

Say: TypeAlias = Callable[[str], None]


class KeyRefused(InputRefused):
    """A value of the scenario that the mesh contradicts."""

    def __init__(self, path: KeyPath, what: str, fix: str) -> None:
        super().__init__(what, where=dotted(path), fix=fix)
        self.path = path


@dataclass(frozen=True, eq=False)
class Built:
    """What a scenario's words stand for.

    Attributes
    ----------
    asteroid : Asteroid
    spacecraft : Spacecraft
    ellipsoid_m : (3,) float, m, or None
        Semi-axes of the keep-out ellipsoid, where the scenario has a ``reach`` section.
    shape_sha256 : str
        Of the shape file.
    """

    asteroid: Asteroid
    spacecraft: Spacecraft
    ellipsoid_m: FloatArray | None
    shape_sha256: str


@dataclass(frozen=True, eq=False)
class Surface:
    """A shape as it was read, about the scenario's origin.

    Attributes
    ----------
    mesh : Mesh
    sha256 : str
        Of the shape file.
    """

    mesh: Mesh
    sha256: str


def build(loaded: LoadedScenario, say: Say = lambda _: None) -> Built:
    """Make everything that a scenario describes.

    Parameters
    ----------
    loaded : LoadedScenario
        As `landing_cli.scenario.load.load` returns it.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    Built

    Raises
    ------
    InputRefused
        A value contradicts the mesh; it is named with its file, line and dotted key.
    """
    return builder_over(read_surface(loaded), say)(loaded)


def read_surface(loaded: LoadedScenario) -> Surface:
    """Read the shape of a scenario.

    Parameters
    ----------
    loaded : LoadedScenario
        The scenario.

    Returns
    -------
    Surface

    Raises
    ------
    InputRefused
        It is missing or broken; the scenario's key is named with its file and line.
    """
    try:
        return _read_surface(loaded.scenario.body, loaded.beside)
    except KeyRefused as error:
        raise _refused(error, loaded) from error


def builder_over(surface: Surface, say: Say = lambda _: None) -> Callable[[LoadedScenario], Built]:
    """Return what builds scenarios over one surface; equal bodies and ellipsoids are made once.

    Parameters
    ----------
    surface : Surface
        What the scenarios' ``body.shape``, ``length_unit`` and ``origin`` stand for.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    callable
        From LoadedScenario to Built; raises as :func:`build` does.
    """
    bodies: dict[str, Asteroid] = {}
    ellipsoids: dict[object, FloatArray] = {}

    def build_one(loaded: LoadedScenario) -> Built:
        scenario, reach = loaded.scenario, loaded.scenario.reach
        body, about = scenario.name + scenario.body.model_dump_json(), _of_ellipsoid(reach)
        try:
            if body not in bodies:
                bodies[body] = asteroid_over(scenario, surface.mesh, say)
            if reach is not None and about not in ellipsoids:
                ellipsoids[about] = resolve_ellipsoid(reach, surface.mesh)
        except KeyRefused as error:
            raise _refused(error, loaded) from error
        return Built(bodies[body], build_spacecraft(scenario), ellipsoids.get(about), surface.sha256)

    return build_one


def _of_ellipsoid(reach: Reach | None) -> object:
    """What the keep-out ellipsoid and its checks depend on beside the mesh."""
    if reach is None:
        return None
    starts = tuple(state.start_m for state in reach.initial_states)
    return reach.ellipsoid_m, starts, reach.terrain, reach.descent


def _refused(error: KeyRefused, loaded: LoadedScenario) -> InputRefused:
    return refusal([Problem(error.path, error.what, error.fix)], loaded.places, loaded.source)


def build_asteroid(scenario: Scenario, beside: Path) -> tuple[Asteroid, str]:
    """Read the shape and make the asteroid of it.

    Parameters
    ----------
    scenario : Scenario
        Its ``body`` section is read.
    beside : Path
        Folder where the shape is searched first.

    Returns
    -------
    Asteroid
        About its centre of mass, or about the file's origin where the scenario says so; the gravity
        models take that origin for the centre of mass, as the papers do that use it.
    str
        SHA-256 of the shape file.

    Raises
    ------
    InputRefused
        The shape is missing or broken, or its size contradicts the unit or the mass.
    """
    surface = _read_surface(scenario.body, beside)
    return asteroid_over(scenario, surface.mesh), surface.sha256


def asteroid_over(scenario: Scenario, mesh: Mesh, say: Say = lambda _: None) -> Asteroid:
    """Make the asteroid of a scenario over a surface that was read already.

    Parameters
    ----------
    scenario : Scenario
        Its ``body`` section says spin and gravity.
    mesh : Mesh
        About the scenario's origin.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    Asteroid

    Raises
    ------
    InputRefused
        The mesh contradicts the unit or the mass.
    """
    body = scenario.body
    gm_m3_s2 = _gravitational_parameter(body.gravity, mass_properties(mesh).volume_m3)
    gravity = _gravity_field(body.gravity, gm_m3_s2, mesh, say)
    return Asteroid(scenario.name, mesh, body.spin_rad_s, gravity, gm_m3_s2)


def _read_surface(body: Body, beside: Path) -> Surface:
    try:
        shape = read_shape(find_shape(body.shape, beside), body.length_unit)
    except InputRefused as error:
        raise KeyRefused(("body", "shape"), f"{error.where}: {error.what}", error.fix) from error
    mesh = centred(shape.mesh) if body.origin == "center_of_mass" else shape.mesh
    return Surface(mesh, shape.sha256)


def build_spacecraft(scenario: Scenario) -> Spacecraft:
    """Make the spacecraft.

    Parameters
    ----------
    scenario : Scenario
        Its ``spacecraft`` section is read.

    Returns
    -------
    Spacecraft
    """
    return Spacecraft(**scenario.spacecraft.model_dump())


def resolve_ellipsoid(reach: Reach, mesh: Mesh) -> FloatArray:
    """Find the keep-out ellipsoid, and refuse initial states inside it.

    Parameters
    ----------
    reach : Reach
        The scenario's ``reach`` section.
    mesh : Mesh
        The asteroid's, about the origin that its states refer to.

    Returns
    -------
    (3,) float, m
        Semi-axes; every vertex lies inside, unless flights must be clear of the terrain itself.

    Raises
    ------
    InputRefused
        A given ellipsoid leaves vertices outside where it may not, or an initial state lies inside it.
    """
    given = reach.ellipsoid_m
    if given == "auto":
        semi_axes = least_volume_ellipsoid(mesh.vertices)
    else:
        semi_axes = np.array(given)
        if reach.terrain == "require" and reach.descent == "free":
            _check_not_small(semi_axes, mesh)
            _check_states(reach, least_volume_ellipsoid(mesh.vertices))
        else:
            _check_holds(semi_axes, mesh)
    _check_states(reach, semi_axes)
    return semi_axes


def _gravitational_parameter(gravity: AnyGravity, volume_m3: float) -> float:
    if gravity.density_kg_m3 is not None:
        return GRAVITATIONAL_CONSTANT * gravity.density_kg_m3 * volume_m3
    assert gravity.gm_m3_s2 is not None
    density = gravity.gm_m3_s2 / (GRAVITATIONAL_CONSTANT * volume_m3)
    if not LIGHTEST_KG_M3 <= density <= HEAVIEST_KG_M3:
        raise KeyRefused(
            ("body", "gravity", "gm_m3_s2"),
            f"{gravity.gm_m3_s2:g} and the shape's volume of {volume_m3:.4g} m3 make {density:.3g} kg/m3",
            "no asteroid is like that: check body.length_unit, and that GM is in m3/s2",
        )
    return gravity.gm_m3_s2


def _gravity_field(gravity: AnyGravity, gm_m3_s2: float, mesh: Mesh, say: Say) -> GravityField:
    if isinstance(gravity, PointMassGravity):
        return point_mass_field(gm_m3_s2)
    if isinstance(gravity, HarmonicsGravity):
        return _harmonics(gravity, gm_m3_s2, mesh)
    if isinstance(gravity, DipoleGravity):
        return _dipole(gravity, gm_m3_s2, mesh)
    if isinstance(gravity, InterpolatedGravity):
        return _interpolated(gm_m3_s2, mesh, say)
    return polyhedron_field(mesh.vertices, mesh.faces, gm_m3_s2)


def _interpolated(gm_m3_s2: float, mesh: Mesh, say: Say) -> GravityField:
    try:
        field = kept_interpolation(mesh.vertices, mesh.faces, lambda: say(FITTING))
        return scaled_field(field, gm_m3_s2)
    except InputRefused as error:
        raise KeyRefused(("body", "gravity", "model"), error.what, error.fix) from error


def _harmonics(gravity: HarmonicsGravity, gm_m3_s2: float, mesh: Mesh) -> GravityField:
    radius_m = gravity.reference_radius_m
    if radius_m is None:
        radius_m = float(np.linalg.norm(mesh.vertices, axis=1).max())
    fitted = degree2_from_mesh(mesh, radius_m)
    coefficients = {
        name: getattr(fitted, name) if getattr(gravity, name) is None else getattr(gravity, name)
        for name in ("c20", "c22", "s22", "c21", "s21")
    }
    return harmonics_field(gm_m3_s2, radius_m, **coefficients)


def _dipole(gravity: DipoleGravity, gm_m3_s2: float, mesh: Mesh) -> GravityField:
    fraction, separation_m = gravity.mass_fraction, gravity.separation_m
    if fraction is None or separation_m is None:
        try:
            fitted = dipole_from_mesh(mesh)
        except InputRefused as error:
            raise KeyRefused(("body", "gravity", "model"), error.what, error.fix) from error
        fraction = fitted.mass_fraction if fraction is None else fraction
        separation_m = fitted.separation_m if separation_m is None else separation_m
    return dipole_field(gm_m3_s2, fraction, separation_m)


def _check_holds(semi_axes: FloatArray, mesh: Mesh) -> None:
    levels = np.sqrt(((mesh.vertices / semi_axes) ** 2).sum(axis=1))
    outside = int((levels > 1.0).sum())
    if outside:
        enough = ", ".join(f"{value:.6g}" for value in semi_axes * levels.max() * (1 + 1e-6))
        raise KeyRefused(
            ("reach", "ellipsoid_m"),
            f"leaves {outside} of the shape's {len(levels)} vertices outside",
            f"take auto, or at least [{enough}]",
        )


def _check_not_small(semi_axes: FloatArray, mesh: Mesh) -> None:
    """Where the terrain keeps flights out of rock, the ellipsoid need not hold all of it."""
    least = SMALLEST_SHARE * least_volume_ellipsoid(mesh.vertices)
    if (semi_axes < least).any():
        enough = ", ".join(f"{value:.6g}" for value in np.maximum(semi_axes, least * (1 + 1e-6)))
        raise KeyRefused(
            ("reach", "ellipsoid_m"),
            f"is smaller than {SMALLEST_SHARE:g} of the least ellipsoid that holds the body",
            f"take auto, or at least [{enough}]",
        )


def _check_states(reach: Reach, semi_axes: FloatArray) -> None:
    for index, state in enumerate(reach.initial_states):
        level = float(np.sqrt(((np.array(state.start_m) / semi_axes) ** 2).sum()))
        if level <= 1.0:
            key = "position_m" if state.position_km is None else "position_km"
            axes = ", ".join(f"{value:.1f}" for value in semi_axes)
            out = f"multiply it by {1.05 / level:.3g}" if level > 0 else "it is the centre"
            raise KeyRefused(
                ("reach", "initial_states", index, key),
                f"{state.name} begins inside the keep-out ellipsoid of [{axes}] m",
                f"start higher: {out}",
            )

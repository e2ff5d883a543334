"""The observed landing of a scenario, with the checks that need the mesh."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.bvh import SurfaceIndex, build_surface_index
from landing_cli.body.clearance import signed_distances
from landing_cli.body.gravity.field import GravityKind
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.body.landing_site import Site
from landing_cli.errors import InputRefused
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.observe.features import ThomasField, placed_landmarks, thomas_landmarks
from landing_cli.observe.illumination import heliocentric_position_m, sun_direction
from landing_cli.observe.landmark_source import landmarks_path
from landing_cli.observe.records import Landmarks, ObserveCase, Prior, Sensor, SiteFrame
from landing_cli.observe.site_frame import site_frame
from landing_cli.scenario.build import KeyRefused
from landing_cli.scenario.landmark_document import read_landmarks
from landing_cli.scenario.load import LoadedScenario
from landing_cli.scenario.messages import Problem, refusal
from landing_cli.scenario.schema_body import Body
from landing_cli.scenario.schema_observe import ObserveSection, SensorSection
from landing_cli.scenario.sections import observe_section
from landing_cli.scenario.site import site_of

FloatArray = NDArray[np.float64]

ASTRONOMICAL_UNIT_M = 149_597_870_700.0


def observe_case(loaded: LoadedScenario, asteroid: Asteroid, spacecraft: Spacecraft) -> ObserveCase:
    """Make the case of a scenario.

    Parameters
    ----------
    loaded : LoadedScenario
        Its ``observe`` section is read, and the file of landmarks that it names.
    asteroid : Asteroid
        Its body; the case may fly in another field of it.
    spacecraft : Spacecraft
        Its spacecraft.

    Returns
    -------
    ObserveCase

    Raises
    ------
    InputRefused
        The scenario has no such section, or the mesh or the landmarks contradict it; the key is named with
        its place.
    """
    section = observe_section(loaded)
    asteroid = with_gravity(section, asteroid)
    surface = build_surface_index(asteroid.mesh)
    try:
        site = site_of(section.site, ("observe", "site"), asteroid.mesh, surface)
        frame = _frame(section, site)
        position, velocity = _start(section, frame, surface)
        landmarks = _landmarks(loaded, section, asteroid, surface, frame)
    except KeyRefused as error:
        raise refusal([Problem(error.path, error.what, error.fix)], loaded.places, loaded.source) from error
    glide_slope = section.glide_slope_half_angle_deg
    return ObserveCase(
        name=_name(section),
        asteroid=asteroid,
        spacecraft=spacecraft,
        position_m=position,
        velocity_m_s=velocity,
        frame=frame,
        time_of_flight="fixed" if isinstance(section.tof_s, float) else section.tof_s,
        tof_s=section.tof_s if isinstance(section.tof_s, float) else math.nan,
        tof_range_s=section.tof_search_s,
        landmarks=landmarks,
        sensor=_sensor(section.sensor),
        prior=Prior(**section.prior.model_dump()),
        sun_direction=sun_of(loaded.scenario.body),
        clearance_m=section.clearance_m,
        clearance_free_m=section.clearance_free_m,
        glide_slope_half_angle_rad=None if glide_slope is None else math.radians(glide_slope),
        surface=surface,
    )


def with_gravity(section: ObserveSection, asteroid: Asteroid) -> Asteroid:
    """Give the body the field that the landing flies in.

    Parameters
    ----------
    section : ObserveSection
        Its ``gravity``.
    asteroid : Asteroid
        In the scenario's own field, which may be too coarse for a flight near the ground.

    Returns
    -------
    Asteroid
        With the polyhedron's field, unless the section asks for the body's.
    """
    if section.gravity == "body" or asteroid.gravity.kind is GravityKind.POLYHEDRON:
        return asteroid
    field = polyhedron_field(asteroid.mesh.vertices, asteroid.mesh.faces, asteroid.gm_m3_s2)
    return replace(asteroid, gravity=field)


def sun_of(body: Body) -> FloatArray | None:
    """Return the direction to the sun in the body frame at the initial time.

    Parameters
    ----------
    body : Body
        The scenario's ``body`` section.

    Returns
    -------
    (3,) float, unit, or None
        None where the scenario says nothing of light.
    """
    if body.sun_direction is not None:
        given = np.array(body.sun_direction)
        return np.asarray(given / np.linalg.norm(given))
    if body.orbit is None or body.pole is None or body.epoch_utc is None:
        return None
    orbit = body.orbit
    since = datetime.fromisoformat(body.epoch_utc) - datetime.fromisoformat(orbit.epoch_utc)
    position = heliocentric_position_m(
        orbit.semi_major_axis_au * ASTRONOMICAL_UNIT_M,
        orbit.eccentricity,
        math.radians(orbit.inclination_deg),
        math.radians(orbit.ascending_node_deg),
        math.radians(orbit.perihelion_argument_deg),
        math.radians(orbit.mean_anomaly_deg),
        since.total_seconds(),
    )
    angles = (body.pole.ra_deg, body.pole.dec_deg, body.pole.w0_deg)
    return sun_direction(position, *map(math.radians, angles))


def _frame(section: ObserveSection, site: Site) -> SiteFrame:
    try:
        return site_frame(site.position_m, site.normal, section.frame, site.facet)
    except InputRefused as error:
        raise KeyRefused(("observe", "frame"), error.what, error.fix) from error


def _start(section: ObserveSection, frame: SiteFrame, surface: SurfaceIndex) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity in the body frame; refuse a start that no landing can begin from."""
    start = section.initial_state
    velocity = np.array(start.velocity_m_s)
    if start.site_position_m is None:
        key, position = "position_m", np.array(start.position_m)
    else:
        key, position = "site_position_m", frame.to_body(np.array(start.site_position_m))
        velocity = velocity @ frame.axes
    path = ("observe", "initial_state", key)
    offset = position - frame.origin_m
    if float(np.linalg.norm(offset)) < 1e-3:
        raise KeyRefused(path, "is the landing site", "start above it")
    height = float(offset @ frame.normal)
    if height <= 0.0:
        what = f"lies {-height:.4g} m below the plane of the site's facet"
        tilt = math.degrees(math.acos(min(1.0, max(-1.0, float(frame.axes[2] @ frame.normal)))))
        fix = "start above the plane"
        if key == "site_position_m" and tilt > 1.0:
            fix += f"; the frame's z is {tilt:.0f} deg off the facet's normal: see observe.frame"
        raise KeyRefused(path, what, fix)
    depth = -float(signed_distances(surface, position[None])[0])
    if depth >= 0.0:
        raise KeyRefused(path, f"lies {depth:.4g} m inside the body", "start outside the surface")
    return position, velocity


def _landmarks(
    loaded: LoadedScenario,
    section: ObserveSection,
    asteroid: Asteroid,
    surface: SurfaceIndex,
    frame: SiteFrame,
) -> Landmarks:
    source = section.landmarks
    if source.synthetic is not None:
        field = ThomasField(**source.synthetic.model_dump())
        found = thomas_landmarks(asteroid.mesh, surface, frame, field)
        path, what = ("observe", "landmarks", "synthetic"), "the drawn field has no landmark on the surface"
        fix = "raise mean_per_cluster or extent_m, or take another seed"
    else:
        table = read_landmarks(landmarks_path(loaded, source))
        found = placed_landmarks(table, asteroid.mesh, surface)
        path, what, fix = ("observe", "landmarks", "file"), "the file lists no landmark", "add at least one"
    if not len(found.position_m):
        raise KeyRefused(path, what, fix)
    return found


def _sensor(section: SensorSection) -> Sensor:
    return Sensor(
        kind=section.kind,
        half_field_of_view_rad=math.radians(section.half_field_of_view_deg),
        boresight=section.boresight,
        range_min_m=section.range_min_m,
        range_max_m=section.range_max_m,
        emission_max_rad=math.radians(section.emission_max_deg),
        incidence_max_rad=math.radians(section.incidence_max_deg),
        range_sigma_m=math.nan if section.range_sigma_m is None else section.range_sigma_m,
        angle_sigma_rad=math.radians(section.angle_sigma_deg),
        rate_hz=section.rate_hz,
    )


def _name(section: ObserveSection) -> str:
    return f"{section.tof_s:.12g}s" if isinstance(section.tof_s, float) else section.tof_s

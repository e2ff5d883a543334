"""The asteroid's section: shape, spin and gravity."""

from __future__ import annotations

import datetime
from typing import Annotated, Any, Literal

from pydantic import Field

from landing_cli.scenario.schema_base import Number3, Section, exactly_one, wrong

SECONDS_PER_HOUR = 3600.0
MODELS = "point_mass | harmonics | dipole | polyhedron | interpolated"
TWO_PI = 6.283185307179586


class Gravity(Section):
    """What every gravity model states: the body's gravitational parameter or its density."""

    model: str = Field(description=MODELS)
    gm_m3_s2: float | None = Field(None, gt=0, le=1e15, description="gravitational parameter, m3/s2")
    density_kg_m3: float | None = Field(
        None, gt=0, le=50_000, description="uniform density, kg/m3, instead of gm_m3_s2"
    )

    def model_post_init(self, context: Any, /) -> None:
        """Refuse a body with two masses, or none."""
        exactly_one(self, "gm_m3_s2", "density_kg_m3")


class PointMassGravity(Gravity):
    """All mass in the centre."""

    model: Literal["point_mass"] = Field(description=MODELS)


class HarmonicsGravity(Gravity):
    """Spherical harmonics of degree 2, unnormalised; from the mesh unless given."""

    model: Literal["harmonics"] = Field(description=MODELS)
    degree: Literal[2] = Field(2, description="highest degree of the expansion")
    reference_radius_m: float | None = Field(
        None, gt=0, le=1e9, description="reference radius, m; the largest vertex radius unless given"
    )
    c20: float | None = Field(None, ge=-1, le=1, description="C20; from the mesh unless given")
    c22: float | None = Field(None, ge=-1, le=1, description="C22; from the mesh unless given")
    s22: float | None = Field(None, ge=-1, le=1, description="S22; from the mesh unless given")
    c21: float | None = Field(None, ge=-1, le=1, description="C21; from the mesh unless given")
    s21: float | None = Field(None, ge=-1, le=1, description="S21; from the mesh unless given")

    def model_post_init(self, context: Any, /) -> None:
        """Refuse coefficients whose reference radius is not said."""
        super().model_post_init(context)
        given = [name for name in ("c20", "c22", "s22", "c21", "s21") if getattr(self, name) is not None]
        if given and self.reference_radius_m is None:
            raise wrong(given[0], "given without reference_radius_m", "state the radius it belongs to, m")


class DipoleGravity(Gravity):
    """Two point masses on the body's x axis that rotate with it; fitted to the mesh unless given."""

    model: Literal["dipole"] = Field(description=MODELS)
    mass_fraction: float | None = Field(
        None, gt=0, lt=1, description="share of the mass on the +x side; from the mesh unless given"
    )
    separation_m: float | None = Field(
        None, gt=0, le=1e9, description="distance between the masses, m; from the mesh unless given"
    )


class PolyhedronGravity(Gravity):
    """The uniform polyhedron itself (Werner and Scheeres)."""

    model: Literal["polyhedron"] = Field(description=MODELS)


class InterpolatedGravity(Gravity):
    """A field fitted to the uniform polyhedron: nearly as exact, and fast enough to solve in."""

    model: Literal["interpolated"] = Field(description=MODELS)


AnyGravity = Annotated[
    PointMassGravity | HarmonicsGravity | DipoleGravity | PolyhedronGravity | InterpolatedGravity,
    Field(discriminator="model"),
]


class Pole(Section):
    """Orientation of the body in the inertial frame (ICRF)."""

    ra_deg: float = Field(ge=-360, le=360, description="right ascension of the spin pole, deg")
    dec_deg: float = Field(ge=-90, le=90, description="declination of the spin pole, deg")
    w0_deg: float = Field(0.0, ge=-360, le=360, description="prime meridian angle W at the epoch, deg")


class Orbit(Section):
    """Heliocentric osculating elements, ecliptic and equinox J2000: where the sun stands."""

    semi_major_axis_au: float = Field(gt=0, le=1e3, description="semi-major axis, au")
    eccentricity: float = Field(ge=0, lt=1, description="eccentricity")
    inclination_deg: float = Field(ge=0, le=180, description="inclination, deg")
    ascending_node_deg: float = Field(ge=-360, le=360, description="longitude of the ascending node, deg")
    perihelion_argument_deg: float = Field(ge=-360, le=360, description="argument of perihelion, deg")
    mean_anomaly_deg: float = Field(ge=-360, le=360, description="mean anomaly at the elements' epoch, deg")
    epoch_utc: str = Field(description="epoch of the elements, UTC, as 2029-04-13T21:46:00")

    def model_post_init(self, context: Any, /) -> None:
        """Refuse an epoch that is no date."""
        _check_epoch(self.epoch_utc)


class Body(Section):
    """The asteroid: shape, spin and gravity."""

    shape: str = Field(
        min_length=1,
        max_length=1000,
        description="shape file: beside this file, in shapes/, in LANDING_REFERENCE_DATA/shapes, or shipped",
    )
    length_unit: Literal["km", "m"] = Field("km", description="unit of the shape file: km | m")
    origin: Literal["center_of_mass", "file"] = Field(
        "center_of_mass", description="origin of the body frame: center_of_mass | file"
    )
    rotation_period_h: float | None = Field(None, ge=0.01, le=1e6, description="rotation period about +z, h")
    rotation_rate_rad_s: float | None = Field(
        None, ge=0, le=0.1, description="rotation rate about +z, rad/s, instead of rotation_period_h"
    )
    gravity: AnyGravity = Field(description="gravity model that the solvers fly in")
    epoch_utc: str | None = Field(None, description="time of the initial state, UTC, as 2029-04-13T21:46:00")
    pole: Pole | None = Field(None, description="spin pole, where an inertial frame matters")
    orbit: Orbit | None = Field(
        None, description="heliocentric orbit, where light matters; with epoch_utc and pole"
    )
    sun_direction: Number3 | None = Field(
        None,
        description="direction to the sun, body frame, at the initial time; of any length; instead of orbit",
    )

    def model_post_init(self, context: Any, /) -> None:
        """Refuse two spins, none, an epoch that is no date, two suns, or half of one."""
        exactly_one(self, "rotation_period_h", "rotation_rate_rad_s")
        if self.epoch_utc is not None:
            _check_epoch(self.epoch_utc)
        if self.sun_direction is not None and not any(self.sun_direction):
            raise wrong("sun_direction", "is zero", "give the direction from the body to the sun")
        if self.sun_direction is not None and max(map(abs, self.sun_direction)) > 1e15:
            raise wrong("sun_direction", "is longer than any way to the sun", "give a unit vector, or metres")
        if self.orbit is None:
            return
        if self.sun_direction is not None:
            raise wrong("sun_direction", "stands beside orbit", "give one of them")
        for name in ("epoch_utc", "pole"):
            if getattr(self, name) is None:
                raise wrong(
                    name, "is missing", "orbit needs it: the sun's direction in the body frame follows"
                )

    @property
    def spin_rad_s(self) -> float:
        """Rotation rate about +z, rad/s."""
        if self.rotation_rate_rad_s is not None:
            return self.rotation_rate_rad_s
        assert self.rotation_period_h is not None
        return TWO_PI / (self.rotation_period_h * SECONDS_PER_HOUR)


def _check_epoch(text: str) -> None:
    try:
        epoch = datetime.datetime.fromisoformat(text)
    except ValueError:
        raise wrong("epoch_utc", f"{text[:40]!r} is no date", "write it as 2029-04-13T21:46:00") from None
    if not 1900 <= epoch.year < 2200:
        raise wrong("epoch_utc", f"the year {epoch.year} is out of range", "1900 to 2199")
    if epoch.utcoffset():
        raise wrong("epoch_utc", f"{text!r} carries a time zone", "write UTC, without an offset")

"""Stored controls flown again, open loop, and what is measured on the way.

Nothing here is taken from the solver: the integrator is another one, thrust and acceleration follow from
the flown path by Newton's law, and every limit is measured on a dense sampling of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.adjacency import mean_edge_m
from landing_cli.body.bvh import SurfaceIndex, build_surface_index
from landing_cli.body.clearance import TOUCHDOWN_TOLERANCE_M, path_clearance
from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations
from landing_cli.body.mesh import Mesh, facet_normals
from landing_cli.flight.control import sampled_control
from landing_cli.flight.gauss import GAUSS_B
from landing_cli.flight.legs import Leg
from landing_cli.flight.replay import replay_many
from landing_cli.flight.trajectory import Trajectory
from landing_cli.reach.delivery import CLEARANCE_SPACING
from landing_cli.reach.flown import case_of_row, flown_legs
from landing_cli.reach.records import FacetSolutions, LandingCase

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Samples in each step of the flown path, and where it comes closest to the ellipsoid.
SAMPLES, FINE_SAMPLES = 8, 64
# This close to touchdown the path's direction is that of its acceleration there, unless that is so much less
# than elsewhere that it turns no more than the last micrometres.
_BLIND_M, _SLIGHT = 0.1, 1e-3

# Measured columns that a run stores too, under the same names.
STORED = (
    "performance_index_m2_s3",
    "delta_v_m_s",
    "fuel_kg",
    "peak_thrust_ratio",
    "peak_thrust_ratio_descent",
    "peak_thrust_ratio_final",
    "ellipsoid_margin",
    "glide_slope_margin_deg",
    "terrain_clearance_min_m",
    "handover_mass_kg",
)
MEASURED = (
    "touchdown_miss_m",
    "touchdown_speed_m_s",
    "handover_miss_m",
    "handover_off_ellipsoid",
    "flown_thrust_ratio_final",
    *STORED,
)
MEASURED_DTYPE = np.dtype([("facet", "i4"), *((name, "f8") for name in MEASURED)])


@dataclass(frozen=True, eq=False)
class Ground:
    """The surface that the paths of a run lead to."""

    surface: SurfaceIndex
    normals: FloatArray
    mean_edge_m: float


def survey_ground(mesh: Mesh) -> Ground:
    """Prepare a mesh for measuring paths over it."""
    return Ground(build_surface_index(mesh), facet_normals(mesh), mean_edge_m(mesh))


def fly_rows(
    case: LandingCase, solutions: FacetSolutions, rows: IntArray, field: GravityField
) -> tuple[list[tuple[Leg, Leg]], list[Trajectory]]:
    """Fly the stored controls of some rows, in a field of choice, by the fast integrator.

    Parameters
    ----------
    case : LandingCase
        What was asked.
    solutions : FacetSolutions
        Its answers.
    rows : (n,) int
        Rows with a flight.
    field : GravityField
        The field to fly in.

    Returns
    -------
    legs, flights : lists
        One entry a row.
    """
    legs = [flown_legs(case, solutions, int(row)) for row in rows]
    flights = replay_many(
        case.position_m,
        case.velocity_m_s,
        case.spacecraft.mass_kg,
        legs,
        rotation_rate_rad_s=case.asteroid.rotation_rate_rad_s,
        field=field,
        exhaust_velocity_m_s=case.spacecraft.exhaust_velocity_m_s,
    )
    return legs, flights


def measure_rows(
    case: LandingCase, solutions: FacetSolutions, rows: IntArray, ground: Ground
) -> NDArray[np.void]:
    """Fly the stored controls of some rows in the case's own gravity and measure the flights.

    Parameters
    ----------
    case : LandingCase
        What was asked.
    solutions : FacetSolutions
        Its answers.
    rows : (n,) int
        Rows with a flight.
    ground : Ground
        The case's surface.

    Returns
    -------
    (n,) structured array of MEASURED_DTYPE
        Columns that a run stores mean the same here.
    """
    measured = np.zeros(len(rows), dtype=MEASURED_DTYPE)
    measured["facet"] = solutions.rows["facet"][rows]
    for i, (legs, flown) in enumerate(
        zip(*fly_rows(case, solutions, rows, case.asteroid.gravity), strict=True)
    ):
        known = solutions.rows[rows[i]]
        own = case_of_row(case, solutions, int(rows[i]))
        values = _measure(own, legs, flown, known["handover_position_m"], ground, int(known["facet"]))
        for name, value in values.items():
            measured[name][i] = value
    return measured


def _measure(
    case: LandingCase,
    legs: tuple[Leg, Leg],
    flown: Trajectory,
    handover_m: FloatArray,
    ground: Ground,
    facet: int,
) -> dict[str, float]:
    """Measure one flight."""
    craft, target = case.spacecraft, legs[1].target_m  # type: ignore[union-attr]
    cut = int(np.searchsorted(flown.t_s, case.descent_s * (1.0 - 1e-9)))
    handed_over = flown.position_m[cut]
    energy, peak = _descent_thrust(case, legs[0])
    margin, descent_path = _ellipsoid_margin(case, flown, cut)
    arc = _Arc(case, flown, cut)
    peak_final = arc.peak_n(planned=case.final_stage_thrust == "paper") / craft.thrust_max_n
    landed_kg = flown.mass_kg[-1]
    path = np.concatenate([descent_path, arc.position_m[1:]])
    radius_m = ground.mean_edge_m
    clearance, _ = path_clearance(
        ground.surface, path, radius_m, TOUCHDOWN_TOLERANCE_M, CLEARANCE_SPACING * radius_m
    )
    return {
        "touchdown_miss_m": math.dist(flown.position_m[-1], target),
        "touchdown_speed_m_s": float(np.linalg.norm(flown.velocity_m_s[-1])),
        "handover_miss_m": math.dist(handed_over, handover_m),
        "handover_off_ellipsoid": abs(float(((handed_over / case.ellipsoid_m) ** 2).sum()) - 1.0),
        "flown_thrust_ratio_final": arc.peak_n(planned=False) / craft.thrust_max_n,
        "performance_index_m2_s3": energy + arc.energy_m2_s3,
        "delta_v_m_s": craft.exhaust_velocity_m_s * math.log(craft.mass_kg / landed_kg),
        "fuel_kg": craft.mass_kg - landed_kg,
        "peak_thrust_ratio": max(peak, peak_final),
        "peak_thrust_ratio_descent": peak,
        "peak_thrust_ratio_final": peak_final,
        "ellipsoid_margin": margin,
        "glide_slope_margin_deg": math.degrees(
            case.glide_slope_half_angle_rad - arc.glide_angle_rad(target, ground.normals[facet])
        ),
        "terrain_clearance_min_m": clearance,
        "handover_mass_kg": flown.mass_kg[cut],
    }


def _descent_thrust(case: LandingCase, leg: Leg) -> tuple[float, float]:
    """Energy (m2/s3) and largest thrust ratio of the descent's control."""
    craft = case.spacecraft
    control = sampled_control(leg, case.asteroid.rotation_rate_rad_s, craft.exhaust_velocity_m_s)
    square = np.einsum("ijk,ijk->ij", control.stages, control.stages)
    energy = 0.5 * float(control.steps_s @ (square @ GAUSS_B)) / craft.mass_kg**2
    peak = math.sqrt(max(float(square.max()), float(_squares(control.knots).max())))
    return energy, peak / craft.thrust_max_n


def _ellipsoid_margin(case: LandingCase, flown: Trajectory, cut: int) -> tuple[float, FloatArray]:
    """Least r'Re r - 1 of the descent, looked at more closely where it is least; and its path, m."""
    cubics = _cubics(flown, 0, cut)
    path = _along(cubics, _powers(SAMPLES))
    lowest = int(np.argmin(_squares(path / case.ellipsoid_m))) // SAMPLES
    near = _along(cubics[max(lowest - 1, 0) : lowest + 2], _powers(FINE_SAMPLES))
    return float(_squares(near / case.ellipsoid_m).min()) - 1.0, path


class _Arc:
    """The final stage of a flight, densely sampled from handover to touchdown."""

    def __init__(self, case: LandingCase, flown: Trajectory, cut: int) -> None:
        steps_s = np.diff(flown.t_s[cut:])
        cubics, per_s = _cubics(flown, cut, len(flown.t_s) - 1), 1.0 / steps_s[:, None, None]
        self.position_m = _along(cubics, _powers(SAMPLES))
        velocity = _along(cubics * per_s, _powers(SAMPLES, 1))
        self.acceleration = _along(cubics * per_s**2, _powers(SAMPLES, 2))
        w = case.asteroid.rotation_rate_rad_s
        thrust = self.acceleration - accelerations(case.asteroid.gravity, self.position_m)
        thrust[:, 0] -= w * (2.0 * velocity[:, 1] + w * self.position_m[:, 0])
        thrust[:, 1] -= w * (-2.0 * velocity[:, 0] + w * self.position_m[:, 1])
        self._thrust_acceleration = thrust
        knots = np.arange(len(flown.t_s) - cut)
        self._mass_kg = np.interp(np.arange(len(thrust)) / SAMPLES, knots, flown.mass_kg[cut:])
        self._sample_s = np.repeat(steps_s / SAMPLES, SAMPLES)

    def peak_n(self, planned: bool) -> float:
        """Largest thrust, N; in the paper's reading that of the planned acceleration alone (eq 14)."""
        acceleration = self.acceleration if planned else self._thrust_acceleration
        return math.sqrt(float((self._mass_kg**2 * _squares(acceleration)).max()))

    @property
    def energy_m2_s3(self) -> float:
        """Half the integral of the squared acceleration, which is linear in time between samples."""
        a, b = self.acceleration[:-1], self.acceleration[1:]
        return float(self._sample_s @ (_squares(a) + np.einsum("ij,ij->i", a, b) + _squares(b))) / 6.0

    def glide_angle_rad(self, target_m: FloatArray, normal: FloatArray) -> float:
        """Largest angle of the path to the facet's normal, seen from touchdown."""
        offset = self.position_m - target_m
        offset = offset[_squares(offset) > _BLIND_M**2]
        squares = _squares(self.acceleration)
        if squares[-1] > _SLIGHT**2 * squares.max():
            offset = np.concatenate([offset, self.acceleration[-1:]])
        along = offset @ normal
        across = np.sqrt(_squares(offset - along[:, None] * normal))
        return float(np.arctan2(across, along).max())


def _cubics(flown: Trajectory, first: int, last: int) -> FloatArray:
    """Cubics between knots, (k, 4, 3) coefficients of powers of the fraction of a step.

    The cubic through both ends' position and velocity leaves the path by less than a micrometre: it is
    exact for the final arc, and the descent's acceleration changes little within an interval of its control.
    """
    knots = slice(first, last + 1)
    h, r, v = np.diff(flown.t_s[knots])[:, None], flown.position_m[knots], flown.velocity_m_s[knots]
    begin, end, chord = v[:-1] * h, v[1:] * h, r[1:] - r[:-1]
    return np.stack([r[:-1], begin, 3.0 * chord - 2.0 * begin - end, begin + end - 2.0 * chord], axis=1)


@cache
def _powers(samples: int, derivative: int = 0) -> FloatArray:
    """Powers 0 to 3 of the fractions 0, 1/samples, ..., 1, or their derivatives, (samples + 1, 4)."""
    fractions = np.arange(samples + 1) / samples
    columns = [np.polynomial.Polynomial.basis(k).deriv(derivative)(fractions) for k in range(4)]
    return np.stack(columns, axis=1)


def _along(cubics: FloatArray, powers: FloatArray) -> FloatArray:
    """Values of cubics at the given fractions, the end of one being the start of the next, (n, 3)."""
    pieces = powers @ cubics
    return np.concatenate([pieces[:, :-1].reshape(-1, 3), pieces[-1, -1:]])


def _squares(vectors: FloatArray) -> FloatArray:
    """Squared lengths of (n, 3) vectors."""
    return np.asarray(np.einsum("ij,ij->i", vectors, vectors))

"""A Bezier curve whose inner control points are free in space, as a cone program with smooth rows.

Lyu 2026, eq 12, is this problem for degree 7 with its two guide points; the paper then restricts them to two
lines. Unknowns, scaled: the free control points P_3 ... P_{n-3}; at even samples the thrust acceleration u, a
bound sigma >= |u| and the velocity increment S spent so far; and the excess gamma of the thrust over its
bound. Position, velocity and acceleration are linear in the control points; only gravity and terrain are not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from landing_cli.body.gravity.field_values import gradients
from landing_cli.flight.acceleration_control import natural_accelerations
from landing_cli.flight.bezier_curve import bezier_basis, first_control_points, last_control_points
from landing_cli.optimize.cone_program import ConeBlock, ConeProgram, SmoothRows
from landing_cli.plan.free_flight import (
    CLEARANCE_MARGIN_M,
    ENERGY_TRACE,
    EXCESS_PRICE,
    REACH,
    cone_matrix,
    sparse_rows,
)
from landing_cli.plan.path_rows import path_rows
from landing_cli.plan.records import Objective, PlanCase

FloatArray = NDArray[np.float64]

U, SIGMA, SPENT, WIDTH = slice(0, 3), 3, 4, 5


@dataclass(frozen=True, eq=False)
class FreeGuides:
    """What is transcribed.

    Attributes
    ----------
    case : PlanCase
    degree : int
        n.
    entry_s : float, s
        From then on the path lies in the cone; before, it keeps the clearance. Infinite: neither is asked.
    samples : int
        Even samples at which the thrust is bound.
    path_samples : int
        Even samples at which the path is bound.
    bucket : int
        Path samples that share a row.
    objective : {"fuel", "energy"}
    thrust_share : float
        Share of the largest thrust that is allowed at the samples; the rest is for the thrust between them.
    """

    case: PlanCase
    degree: int
    entry_s: float
    samples: int
    path_samples: int
    bucket: int
    objective: Objective
    thrust_share: float = 1.0

    @property
    def length_m(self) -> float:
        """Unit of length: from the start to the site."""
        return float(np.linalg.norm(self.case.position_m - self.case.site.position_m))

    @property
    def acceleration_m_s2(self) -> float:
        """Unit of acceleration: the largest thrust on the initial mass."""
        return self.case.spacecraft.thrust_max_n / self.case.spacecraft.mass_kg

    @property
    def guides(self) -> int:
        """How many control points are free."""
        return self.degree - 5

    @property
    def unknowns(self) -> int:
        """How many."""
        return 3 * self.guides + WIDTH * self.samples + 1

    @property
    def columns(self) -> NDArray[np.int64]:
        """Places of the samples' unknowns, (samples, 5); the guides come first, the excess last."""
        return 3 * self.guides + np.arange(WIDTH * self.samples).reshape(-1, WIDTH)


def control_points(guides: FreeGuides, x: FloatArray) -> FloatArray:
    """Return all control points of scaled unknowns, (n + 1, 3) float, m."""
    case, n = guides.case, guides.degree
    ends = case.tof_s, case.position_m, case.velocity_m_s, case.acceleration_m_s2
    landing = case.tof_s, case.site.position_m, case.landing_velocity_m_s, case.landing_acceleration_m_s2
    free = x[: 3 * guides.guides].reshape(-1, 3) * guides.length_m
    return np.concatenate([first_control_points(n, *ends), free, last_control_points(n, *landing)])


def guides_through(guides: FreeGuides, path_m: FloatArray) -> FloatArray:
    """Unknowns of the curve closest to a path.

    Parameters
    ----------
    guides : FreeGuides
        What is transcribed.
    path_m : (k, 3) float, m, body frame
        Even samples.

    Returns
    -------
    (m,) float
        Scaled unknowns with the thrust that flies the curve.
    """
    x = np.zeros(guides.unknowns)
    basis = bezier_basis(guides.degree, np.linspace(0.0, 1.0, len(path_m)))
    free = slice(3, guides.degree - 2)
    rest = path_m - basis @ control_points(guides, x)
    fitted = np.linalg.lstsq(basis[:, free], rest, rcond=None)[0]
    x[: 3 * guides.guides] = fitted.ravel() / guides.length_m
    columns = guides.columns
    x[columns[:, U]] = _thrust(guides, x)[0] / guides.acceleration_m_s2
    x[columns[:, SIGMA]] = np.linalg.norm(x[columns[:, U]], axis=1)
    bound = x[columns[:, SIGMA]]
    x[columns[1:, SPENT]] = np.cumsum(0.5 * (bound[1:] + bound[:-1])) / (guides.samples - 1)
    x[-1] = max(0.0, float(bound.max()) - guides.thrust_share)
    return x


def free_guides_program(guides: FreeGuides) -> ConeProgram:
    """Transcribe a landing along a Bezier curve.

    Parameters
    ----------
    guides : FreeGuides
        What to transcribe.

    Returns
    -------
    ConeProgram
    """
    columns, m = guides.columns, guides.unknowns
    cost, reach = np.zeros(m), np.full(m, np.inf)
    cost[-1] = EXCESS_PRICE
    # energy: a trace of S keeps sigma on |u|, for the flown mass and the propellant
    cost[columns[-1, SPENT]] = 1.0 if guides.objective == "fuel" else ENERGY_TRACE
    reach[: 3 * guides.guides] = 2.0 * REACH
    pick = sparse.eye_array(m, format="csr")
    blocks = (*_thrust_blocks(guides, pick), *_cone_blocks(guides, pick))
    quadratic = _energy(guides) if guides.objective == "energy" else None
    return ConeProgram(cost, blocks, lambda x: _smooth(guides, x), reach, quadratic, elastic_equalities=False)


def _thrust_blocks(guides: FreeGuides, pick: sparse.csr_array) -> list[ConeBlock]:
    """Ball, bound, and the velocity increment by the trapezoidal rule."""
    columns, k = guides.columns, guides.samples
    ball = pick[np.concatenate([columns[:, [SIGMA]], columns[:, U]], axis=1).ravel()]
    bound, spent = pick[columns[:, SIGMA]], pick[columns[:, SPENT]]
    growth = spent[1:] - spent[:-1] - (bound[1:] + bound[:-1]) * (0.5 / (k - 1))
    blocks = [
        ConeBlock("second_order", ball, np.zeros(4 * k), 4),
        ConeBlock("nonnegative", pick[[-1]], np.zeros(1)),
        ConeBlock("zero", growth, np.zeros(k - 1)),
        ConeBlock("zero", spent[:1], np.zeros(1)),
    ]
    if guides.case.mass_model == "constant":
        excess = sparse.csr_array(np.ones((k, 1))) @ pick[[-1]]
        blocks.append(ConeBlock("nonnegative", excess - bound, np.full(k, guides.thrust_share)))
    return blocks


def _cone_blocks(guides: FreeGuides, pick: sparse.csr_array) -> list[ConeBlock]:
    """The safety cone at the samples after the entry, which are linear in the guides.

    Towards a landing at rest without acceleration the curve leaves the site along P_{n-3} - r_f.
    """
    case, n = guides.case, guides.degree
    if not np.isfinite(guides.entry_s):
        return []
    tau = np.linspace(0.0, 1.0, guides.samples)[:-1]
    basis = bezier_basis(n, tau[tau * case.tof_s >= guides.entry_s])
    if not np.any(case.landing_velocity_m_s) and not np.any(case.landing_acceleration_m_s2):
        basis = np.concatenate([basis, np.eye(n + 1)[[n - 3]]])
    lift = cone_matrix(case)
    fixed = basis @ control_points(guides, np.zeros(guides.unknowns)) - case.site.position_m
    rows = sparse.csr_array(np.kron(basis[:, 3 : n - 2], lift)) @ pick[: 3 * guides.guides]
    return [ConeBlock("second_order", rows, (fixed @ lift.T).ravel() / guides.length_m, 4)]


def _energy(guides: FreeGuides) -> sparse.csr_array:
    """P with x'Px/2 = (1/t_f) integral |u|^2 dt by the trapezoidal rule."""
    weight = np.full(guides.samples, 2.0 / (guides.samples - 1))
    weight[[0, -1]] /= 2.0
    diagonal = np.zeros(guides.unknowns)
    diagonal[guides.columns[:, U]] = weight[:, None]
    return sparse.csr_array(sparse.diags_array(diagonal))


def _thrust(guides: FreeGuides, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Thrust acceleration at the samples (k, 3), m/s2, and its slope by the guides (k, 3, 3 g)."""
    case, n, tof = guides.case, guides.degree, guides.case.tof_s
    tau = np.linspace(0.0, 1.0, guides.samples)
    bases = [bezier_basis(n, tau, order) / tof**order for order in range(3)]
    r, v, a = (basis @ control_points(guides, x) for basis in bases)
    field, w = case.asteroid.gravity, case.asteroid.rotation_rate_rad_s
    natural = np.zeros_like(r)
    natural_accelerations(field.kind, field.params, w, r, v, natural)
    by_r = gradients(field, r) + np.diag([w * w, w * w, 0.0])
    by_v = np.array([[0.0, 2.0 * w, 0.0], [-2.0 * w, 0.0, 0.0], [0.0, 0.0, 0.0]])
    free = [basis[:, 3 : n - 2] for basis in bases]
    slope = np.einsum("kg,ab->kagb", free[2], np.eye(3))
    slope -= np.einsum("kg,kab->kagb", free[0], by_r) + np.einsum("kg,ab->kagb", free[1], by_v)
    return a - natural, slope.reshape(guides.samples, 3, -1)


def _smooth(guides: FreeGuides, x: FloatArray) -> SmoothRows:
    """Thrust that flies the curve, and the room of path, thrust and propellant."""
    columns, unit = guides.columns, guides.acceleration_m_s2
    u, slope = _thrust(guides, x)
    free = np.arange(3 * guides.guides)
    place = np.broadcast_to(free, (3 * guides.samples, len(free)))
    own = columns[:, U].reshape(-1, 1)
    gaps = sparse_rows(
        np.concatenate([slope.reshape(len(own), -1) * guides.length_m / unit, -np.ones_like(own)], axis=1),
        np.concatenate([place, own], axis=1),
        guides.unknowns,
    )
    path, path_slope = _path(guides, x)
    mass, mass_slope = _mass(guides, x)
    return SmoothRows(
        (u / unit - x[columns[:, U]]).ravel(),
        gaps,
        np.concatenate([path, mass]),
        sparse.csr_array(sparse.vstack([path_slope, mass_slope])),
        np.concatenate([np.full(len(path), 4.0 * REACH), np.full(len(mass), np.inf)]),
    )


def _path(guides: FreeGuides, x: FloatArray) -> tuple[FloatArray, sparse.csr_array]:
    if not np.isfinite(guides.entry_s):
        return np.zeros(0), sparse.csr_array((0, guides.unknowns))
    n, tau = guides.degree, np.linspace(0.0, 1.0, guides.path_samples)
    entry = int(np.searchsorted(tau * guides.case.tof_s, guides.entry_s))
    basis = bezier_basis(n, tau)
    positions = basis @ control_points(guides, x)
    rows = path_rows(guides.case, positions, entry, guides.bucket, CLEARANCE_MARGIN_M)
    slope = np.einsum("qg,qa->qga", basis[rows.sample][:, 3 : n - 2], rows.slope).reshape(len(rows.value), -1)
    place = np.broadcast_to(np.arange(slope.shape[1]), slope.shape)
    return rows.value / guides.length_m, sparse_rows(slope, place, guides.unknowns)


def _mass(guides: FreeGuides, x: FloatArray) -> tuple[FloatArray, sparse.csr_array]:
    """Room of thrust under the flown mass, sigma <= exp(S/ve) + gamma, and of the propellant."""
    case, columns = guides.case, guides.columns
    kappa = guides.acceleration_m_s2 * case.tof_s / case.spacecraft.exhaust_velocity_m_s
    values, slopes = [np.zeros(0)], [sparse.csr_array((0, guides.unknowns))]
    pick = sparse.eye_array(guides.unknowns, format="csr")
    if case.mass_model == "variable":
        growth = guides.thrust_share * np.exp(kappa * x[columns[:, SPENT]])
        rows = sparse.diags_array(kappa * growth) @ pick[columns[:, SPENT]] - pick[columns[:, SIGMA]]
        values.append(growth + x[-1] - x[columns[:, SIGMA]])
        slopes.append(rows + sparse.csr_array(np.ones((guides.samples, 1))) @ pick[[-1]])
    if case.spacecraft.propellant_kg is not None:
        share = case.spacecraft.propellant_kg / case.spacecraft.mass_kg
        bound = share if case.mass_model == "constant" else -np.log1p(-min(share, 1.0 - 1e-9))
        values.append(np.array([bound / kappa - x[columns[-1, SPENT]]]))
        slopes.append(-pick[columns[-1:, SPENT]])
    return np.concatenate(values), sparse.csr_array(sparse.vstack(slopes))

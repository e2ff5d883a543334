"""How well the position is known along a path: a covariance filter, and its exact slopes.

The filter is that of an extended Kalman filter linearised on the path: between two times of the sensor the
covariance of (position, velocity) flows with the linearised dynamics of eq 1 and an unmodelled white
acceleration, at each of them the landmarks' information is added (Bar-Shalom, Li and Kirubarajan, Estimation
with Applications to Tracking and Navigation, 2001, sections 5.2 and 6.2).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.gravity.field_values import gradients
from landing_cli.kernel import kernel, part
from landing_cli.observe.measurements import hard_sight, information_along
from landing_cli.observe.observed import Path, Seen, Sigma
from landing_cli.observe.path_samples import positions_at
from landing_cli.observe.records import ObserveCase, Prior

FloatArray = NDArray[np.float64]

_EXPONENTIAL_TERMS = 8  # a step of a minute turns Eros by 0.02: the next term is below rounding


def sigma_along(case: ObserveCase, path: Path, seen: Seen) -> Sigma:
    """Tell how well the position is known along a path.

    Parameters
    ----------
    case : ObserveCase
        Landmarks, sensor and prior.
    path : Path
        The flown path.
    seen : Seen
        Which landmarks are in view at the sensor's times.

    Returns
    -------
    Sigma
    """
    transitions = state_transitions(case.asteroid, path.t_s, path.position_m, seen.t_s)
    information = information_along(hard_sight(case, seen.visible), positions_at(path, seen.t_s))
    return Sigma(seen.t_s, position_sigmas(case.prior, seen.t_s, transitions, information))


def state_transitions(
    asteroid: Asteroid, node_s: FloatArray, position_m: FloatArray, t_s: FloatArray
) -> FloatArray:
    """Linearise the motion along a path.

    Parameters
    ----------
    asteroid : Asteroid
        Its field and spin.
    node_s : (k,) float, s
        Times of the positions below, which the field's gradient is interpolated between.
    position_m : (k, 3) float, m, body frame
        The path at these nodes.
    t_s : (T,) float, s
        Times between which the transitions are wanted.

    Returns
    -------
    (T - 1, 6, 6) float, SI, rotating body frame
        Exponentials of the dynamics in the middle of each step.
    """
    w, middle = asteroid.rotation_rate_rad_s, 0.5 * (t_s[1:] + t_s[:-1])
    nodes = gradients(asteroid.gravity, position_m).reshape(-1, 9)
    gradient = np.stack([np.interp(middle, node_s, column) for column in nodes.T], axis=1).reshape(-1, 3, 3)
    rates = np.zeros((len(middle), 6, 6))
    rates[:, :3, 3:] = np.eye(3)
    rates[:, 3:, :3] = gradient + np.diag([w * w, w * w, 0.0])
    rates[:, 3:, 3:] = [[0.0, 2.0 * w, 0.0], [-2.0 * w, 0.0, 0.0], [0.0, 0.0, 0.0]]
    rates *= np.diff(t_s)[:, None, None]
    transitions = np.tile(np.eye(6), (len(middle), 1, 1))
    term = transitions.copy()
    for k in range(1, _EXPONENTIAL_TERMS + 1):
        term = term @ rates / k
        transitions += term
    return transitions


def position_sigmas(
    prior: Prior, t_s: FloatArray, transitions: FloatArray, information: FloatArray
) -> FloatArray:
    """Filter the information along a path.

    Parameters
    ----------
    prior : Prior
        Of the initial state, and the unmodelled acceleration.
    t_s : (T,) float, s
        Times of the sensor.
    transitions : (T - 1, 6, 6) float, SI
        From each time to the next.
    information : (T, 3, 3) float, 1/m2
        About the position, of all landmarks together.

    Returns
    -------
    (T,) float, m
        Root of the trace of the position covariance after each update.
    """
    _, after = _filtered(prior, t_s, transitions, information)
    return np.sqrt(np.trace(after[:, :3, :3], axis1=1, axis2=2))


def mean_sigma_with_slopes(
    prior: Prior, t_s: FloatArray, transitions: FloatArray, information: FloatArray
) -> tuple[float, FloatArray]:
    """Mean position sigma, and its slopes by the information (the filter run backwards).

    Parameters
    ----------
    prior : Prior
        Of the initial state, and the unmodelled acceleration.
    t_s : (T,) float, s
        Times of the sensor.
    transitions : (T - 1, 6, 6) float, SI
        From each time to the next.
    information : (T, 3, 3) float, 1/m2
        About the position, of all landmarks together.

    Returns
    -------
    mean : float, m
    slopes : (T, 3, 3) float, m3
        Symmetric: the slope by each entry, the mirrored one apart.
    """
    before, after = _filtered(prior, t_s, transitions, information)
    sigmas = np.sqrt(np.trace(after[:, :3, :3], axis1=1, axis2=2))
    slopes = np.zeros_like(information)
    _run_backwards(transitions, information, before, after, 0.5 / (len(t_s) * sigmas), slopes)
    return float(sigmas.mean()), slopes


def _filtered(
    prior: Prior, t_s: FloatArray, transitions: FloatArray, information: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Covariances before and after each update, (T, 6, 6) each."""
    before, after = np.zeros((2, len(t_s), 6, 6))
    variance = np.repeat([prior.position_sigma_m**2, prior.velocity_sigma_m_s**2], 3)
    before[0] = np.diag(variance)
    h = np.diff(t_s)
    noise = np.zeros((len(h), 6, 6))
    for a in range(3):
        noise[:, a, a] = h**3 / 3.0
        noise[:, a, a + 3] = noise[:, a + 3, a] = h**2 / 2.0
        noise[:, a + 3, a + 3] = h
    _run(transitions, prior.acceleration_noise_m2_s3 * noise, information, before, after)
    return before, after


@part
def _gain(P: FloatArray, information: FloatArray, kept: FloatArray) -> None:
    """Write I - P H' M (I + H P H' M)^-1 H: the update takes P to ``kept P``; M may be singular.

    It is the 3 x 3 inverse by cofactors.
    """
    A = np.zeros((3, 3))
    for a in range(3):
        A[a, a] = 1.0
        for b in range(3):
            for c in range(3):
                A[a, b] += P[a, c] * information[c, b]
    C = np.zeros((3, 3))
    for a in range(3):
        i, j = (a + 1) % 3, (a + 2) % 3
        for b in range(3):
            k, m = (b + 1) % 3, (b + 2) % 3
            C[b, a] = A[i, k] * A[j, m] - A[i, m] * A[j, k]
    determinant = A[0, 0] * C[0, 0] + A[0, 1] * C[1, 0] + A[0, 2] * C[2, 0]
    kept[:] = 0.0
    for a in range(6):
        kept[a, a] = 1.0
        for b in range(3):
            for c in range(3):
                pulled = 0.0
                for d in range(3):
                    pulled += P[a, d] * information[d, c]
                kept[a, b] -= pulled * C[c, b] / determinant


@part
def _sandwich(left: FloatArray, P: FloatArray, transposed: bool, out: FloatArray) -> None:
    """Write left P left', or left' P left where transposed, of 6 x 6 matrices, P symmetric."""
    half = np.zeros((6, 6))
    for a in range(6):
        for c in range(6):
            factor = left[c, a] if transposed else left[a, c]
            if factor != 0.0:
                for b in range(6):
                    half[a, b] += factor * P[c, b]
    for a in range(6):
        for b in range(a + 1):
            total = 0.0
            for c in range(6):
                total += half[a, c] * (left[c, b] if transposed else left[b, c])
            out[a, b] = total
            out[b, a] = total


@kernel
def _run(
    transitions: FloatArray,
    noise: FloatArray,
    information: FloatArray,
    before: FloatArray,
    after: FloatArray,
) -> None:
    kept = np.zeros((6, 6))
    for t in range(before.shape[0]):
        P = before[t]
        if t > 0:
            _sandwich(transitions[t - 1], after[t - 1], False, P)
            for a in range(6):
                for b in range(6):
                    P[a, b] += noise[t - 1, a, b]
        _gain(P, information[t], kept)
        for a in range(6):
            for b in range(a + 1):
                total = 0.0
                for c in range(6):
                    total += kept[a, c] * P[c, b]
                after[t, a, b] = total
                after[t, b, a] = total


@kernel
def _run_backwards(
    transitions: FloatArray,
    information: FloatArray,
    before: FloatArray,
    after: FloatArray,
    by_variance: FloatArray,
    slopes: FloatArray,
) -> None:
    """Slopes by the information from those by the position variances, (T,), after each update.

    With P+ = (P^-1 + H' M H)^-1 = K P:  dP+ = K dP K' - P+ H' dM H P+.
    """
    by_after, by_before, kept = np.zeros((6, 6)), np.zeros((6, 6)), np.zeros((6, 6))
    for t in range(before.shape[0] - 1, -1, -1):
        for a in range(3):
            by_after[a, a] += by_variance[t]
        _sandwich(after[t], by_after, False, by_before)
        for a in range(3):
            for b in range(3):
                slopes[t, a, b] = -by_before[a, b]
        _gain(before[t], information[t], kept)
        _sandwich(kept, by_after, True, by_before)
        if t > 0:
            _sandwich(transitions[t - 1], by_before, True, by_after)

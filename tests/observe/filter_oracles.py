"""The mean position sigma written again in plain numpy, from the measurement equations, for complex steps."""

from __future__ import annotations

from typing import Any

import numpy as np

from landing_cli.observe.records import ObserveCase


def partials(case: ObserveCase, p: Any, j: int, step: float = 1e-30) -> Any:
    """By complex steps about p, the axes held: (3, 3)."""
    offset = case.landmarks.position_m[j] - p
    u = offset / np.linalg.norm(offset)
    across = np.linalg.svd(u[None])[2][1:]
    columns = []
    for a in range(3):
        moved = case.landmarks.position_m[j] - (p + 1j * step * np.eye(3)[a])
        rho = np.sqrt(moved @ moved)
        columns.append(np.concatenate([[rho.imag], (across @ moved / rho).imag]) / step)
    return np.stack(columns, axis=1)


def logistic(x: Any) -> Any:
    return 1.0 / (1.0 + np.exp(-x))


def weights(case: ObserveCase, p: Any, s: float) -> Any:
    """Smooth weights of the landmarks from one position, (n,), complex allowed."""
    sensor, marks = case.sensor, case.landmarks
    offset = marks.position_m - p
    rho = np.sqrt((offset * offset).sum(axis=1))
    u = offset / rho[:, None]
    axis = -case.frame.axes[2]
    if sensor.boresight == "site":
        axis = case.frame.origin_m - p
        axis = axis / np.sqrt(axis @ axis)
    weight = logistic(np.log(rho / sensor.range_min_m) / s) * logistic(np.log(sensor.range_max_m / rho) / s)
    half, emission = sensor.half_field_of_view_rad, sensor.emission_max_rad
    weight = weight * logistic((u @ axis - np.cos(half)) / (s * np.sin(half)))
    return weight * logistic((-(u * marks.normal).sum(axis=1) - np.cos(emission)) / (s * np.sin(emission)))


def information(case: ObserveCase, p: Any, counted: Any) -> Any:
    """Information of all landmarks from one position, (3, 3), complex allowed."""
    sensor, total = case.sensor, np.zeros((3, 3), dtype=complex)
    alpha = sensor.range_sigma_m**-2 if sensor.kind == "lidar" else 0.0
    for j, weight in enumerate(counted):
        offset = case.landmarks.position_m[j] - p
        rho2 = offset @ offset
        uu = np.outer(offset, offset) / rho2
        total += weight * (alpha * uu + (np.eye(3) - uu) / (rho2 * sensor.angle_sigma_rad**2))
    return total


def mean_sigma(case: ObserveCase, t: Any, transitions: Any, informations: Any) -> Any:
    """The filter in information form: mean root trace of the position covariance."""
    prior, sigmas = case.prior, []
    variance = np.repeat([prior.position_sigma_m**2, prior.velocity_sigma_m_s**2], 3)
    P = np.diag(variance).astype(complex)
    for k in range(len(t)):
        if k:
            h = t[k] - t[k - 1]
            noise = np.block(
                [[h**3 / 3 * np.eye(3), h**2 / 2 * np.eye(3)], [h**2 / 2 * np.eye(3), h * np.eye(3)]]
            )
            P = transitions[k - 1] @ P @ transitions[k - 1].T + prior.acceleration_noise_m2_s3 * noise
        inverse = np.linalg.inv(P)
        inverse[:3, :3] += informations[k]
        P = np.linalg.inv(inverse)
        sigmas.append(np.sqrt(np.trace(P[:3, :3])))
    return np.mean(sigmas)

"""Gravity of a shape as a uniform polyhedron: values and slopes by the polyhedral-gravity package.

In the program gravity is that of a dipole plus a correction at every node, c = (g - g0, d(g - g0)/dr, r),
which is linear about the place where the node was; `corrected` solves again with corrections taken anew
until they hold, so that the answer is one under the package's own values.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

import numpy as np
import polyhedral_gravity as pg
from collocation import Local, solve
from problem import CORRECTION, THRUST_SAMPLES, Problem
from shape import moments, read_obj

SHAPES = Path(__file__).resolve().parent.parent.parent / "shapes"
PACKAGE_G = 6.67430e-11
HOLDS = 2e-6  # largest error of gravity along the path, of the acceleration at full thrust
ROUNDS = 8


@lru_cache(maxsize=1)
def body(name: str, sha256: str, gm: float) -> pg.GravityEvaluable:
    """The package's body; in metres its orientation check would heal a right mesh to half its gravity."""
    if shape_sha256(name) != sha256:
        raise ValueError(f"{name} is not the shape that the table was made with")
    shape = read_obj(SHAPES / name)
    density = gm / PACKAGE_G / moments(shape.corners)[0]
    check = pg.PolyhedronIntegrity.DISABLE
    return pg.GravityEvaluable(pg.Polyhedron((shape.vertices, shape.faces), density, integrity_check=check))


def shape_sha256(name: str) -> str:
    return hashlib.sha256((SHAPES / name).read_bytes()).hexdigest()


def pull(problem: Problem, points: np.ndarray, parallel: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Acceleration (k, 3) and its gradient (k, 3, 3), SI."""
    _, gm, _, _, name, sha256 = problem.gravity
    rows = body(name, sha256, gm)(np.atleast_2d(points), parallel)
    rows = rows if isinstance(rows, list) else [rows]
    xx, yy, zz, xy, xz, yz = np.array([row[2] for row in rows]).T
    gradient = np.moveaxis(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), 2, 0)
    return np.array([row[1] for row in rows]), gradient


def dipole(problem: Problem, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same of the dipole that is corrected."""
    _, gm, fraction, separation, *_ = problem.gravity
    g, gradient = np.zeros((len(points), 3)), np.zeros((len(points), 3, 3))
    for share, x in ((fraction, (1 - fraction) * separation), (1 - fraction, -fraction * separation)):
        d = points - [x, 0.0, 0.0]
        r = np.linalg.norm(d, axis=1)[:, None]
        g -= gm * share * d / r**3
        outer = 3 * d[:, :, None] * d[:, None, :] / r[:, :, None] ** 5
        gradient += gm * share * (outer - np.eye(3) / r[:, :, None] ** 3)
    return g, gradient


def places(problem: Problem, path: Local) -> np.ndarray:
    """Nodes of the path and samples of its final arc, scaled."""
    T = problem.t_final / problem.time
    d, v, r_c = (
        path.x[-1, :3] - np.array(problem.r_c) / problem.length,
        path.x[-1, 3:6],
        np.array(problem.r_c),
    )
    A, B = 3 * d / T**2 + v / T, -2 * d / T**3 - v / T**2
    s = np.linspace(0.0, T, THRUST_SAMPLES)[:, None]
    return np.concatenate([path.x[:, :3], r_c / problem.length + s**2 * (A + B * s)])


def corrections(problem: Problem, path: Local) -> np.ndarray:
    """Corrections (k, CORRECTION) at the nodes of a path and the samples of its arc, scaled."""
    at = places(problem, path)
    (g, G), (g0, G0) = pull(problem, at * problem.length), dipole(problem, at * problem.length)
    T, L = problem.time, problem.length
    rows = [(g - g0) * T**2 / L, (G - G0).reshape(-1, 9) * T**2, at]
    found = np.hstack(rows)
    assert found.shape[1] == CORRECTION
    return found


def error(problem: Problem, path: Local, correction: np.ndarray) -> float:
    """Largest error of gravity along a path that was solved with some correction, of T_max / m0."""
    new = corrections(problem, path)
    moved = new[:, 12:] - correction[:, 12:]
    slopes = correction[:, 3:12].reshape(-1, 3, 3)
    wrong = correction[:, :3] + np.einsum("kij,kj->ki", slopes, moved) - new[:, :3]
    a_max = problem.thrust / problem.mass * problem.time**2 / problem.length
    return float(np.linalg.norm(wrong, axis=1).max() / a_max)


def corrected(problem: Problem, n: int, mode: str, path: Local) -> tuple[Local, float]:
    """A path solved again under the polyhedron, and the largest error of gravity that is left along it."""
    left = np.inf
    for _ in range(ROUNDS):
        correction = corrections(problem, path)
        again = solve(problem, n, mode, path.x, path.u, path.tau, correction)
        if not again.solved:
            return again, left
        path, left = again, error(problem, again, correction)
        if left < HOLDS:
            break
    return path, left

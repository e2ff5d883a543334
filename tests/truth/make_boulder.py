"""Make terrain/boulder.csv: least J past a sphere that stands in the way of the best flight.

Run from anywhere: ``nice python tests/truth/make_boulder.py``; see README.md beside it.
"""

from __future__ import annotations

import csv
import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from collocation import ARC_SAMPLES, Local, best_over_starts, solve
from problem import Problem

HERE = Path(__file__).resolve().parent
INTERVALS = 40
RADIUS_M = 25.0
# where on the free flight the boulder stands (time over the time of flight), and how far beside it, m
PLACES = ((0.80, 8.0), (0.84, -5.0), (0.72, 6.0), (0.76, 15.0))
SITES = ((0.6, 0.3, 0.74), (0.9, -0.2, 0.35))
STARTS = ("straight", "far", "left", "right")
BASE = Problem(
    r0=(0.0, 100.0, 800.0),
    v0=(0.0, 0.0, 0.0),
    omega=2 * np.pi / (4.288 * 3600),
    gravity=("harmonics", 4.892, 246.0, -0.02, 0.004, 0.0),
    mass=2000.0,
    thrust=20.0,
    isp=400.0,
    tof=900.0,
    t_final=200.0,
    semi_axes=(290.0, 280.0, 270.0),
    theta=np.pi / 3,
)


def flight_m(problem: Problem, path: Local) -> np.ndarray:
    """Points of a flight, evenly spaced in time in each stage, and their times over the time of flight."""
    L, T, Tf = problem.length, problem.time, problem.t_final
    descent = np.column_stack([np.linspace(0.0, T, len(path.x)), path.x[:, :3] * L])
    r, v, c = path.x[-1, :3] * L, path.x[-1, 3:6] * L / T, np.array(problem.r_c)
    s = np.linspace(Tf, 0.0, ARC_SAMPLES + 1)[1:, None]
    a, b = 3 * (r - c) / Tf**2 + v / Tf, -2 * (r - c) / Tf**3 - v / Tf**2
    points = np.concatenate([descent, np.column_stack([problem.tof - s, c + s**2 * (a + b * s)])])
    points[:, 0] /= problem.tof
    return points


def boulder_beside(problem: Problem, path: Local, when: float, beside: float) -> tuple[float, ...]:
    """A sphere that a flight goes through, its centre to one side."""
    points = flight_m(problem, path)
    at = np.array([np.interp(when, points[:, 0], column) for column in points[:, 1:].T])
    ahead = np.array([np.interp(when + 0.01, points[:, 0], column) for column in points[:, 1:].T])
    across = np.cross(ahead - at, at)
    return (*np.round(at + beside * across / np.linalg.norm(across), 3), RADIUS_M)


def aside(problem: Problem, path: Local) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Starts: the free flight, its end moved to every side."""
    ramp = np.linspace(0.0, 1.0, len(path.x))[:, None] ** 2
    along = path.x[-1, :3] / np.linalg.norm(path.x[-1, :3])
    e = np.cross(along, [0.3, 0.5, 0.8])
    e /= np.linalg.norm(e)
    sides = {"e": e, "-e": -e, "f": np.cross(along, e), "-f": -np.cross(along, e), "up": along}
    moved = {}
    for name, side in sides.items():
        x = path.x.copy()
        x[:, :3] += 1.5 * RADIUS_M / problem.length * ramp * side
        moved[name] = x, path.u
    return moved


def main() -> None:
    """Solve every boulder before every site."""
    rng, lines, rows = np.random.default_rng(11), [], []
    for site, direction in enumerate(SITES):
        normal = np.array(direction) / np.linalg.norm(direction)
        free_problem = BASE.at(np.round(240.0 * normal, 6), normal)
        free = best_over_starts(free_problem, INTERVALS, "j", rng, names=STARTS).best
        assert free is not None
        coarse = solve(free_problem, INTERVALS, "j", *_thinned(free), 1.0)
        for number, (when, beside) in enumerate(PLACES):
            name = f"site_{site}_boulder_{number}"
            boulder = boulder_beside(free_problem, free, when, beside)
            problem = replace(free_problem, boulder=boulder)
            extra = aside(problem, coarse) | {"free": (coarse.x, coarse.u)}
            found = best_over_starts(problem, INTERVALS, "j", rng, extra, names=())
            best, half = found.best, found.half
            assert best is not None and half is not None, name
            lines.append("# " + json.dumps({"case": name, **asdict(problem)}))
            rows.append([name, f"{free.j:.9g}", f"{half.j:.9g}", f"{best.j:.9g}", found.statuses])
            print(*rows[-1], f"{best.j / free.j - 1:.3%}", flush=True)
    with (HERE / "terrain" / "boulder.csv").open("w", newline="") as file:
        file.write("\n".join(lines) + "\n")
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["case", "j_free_m2_s3", "j_half", "j_m2_s3", "j_starts"])
        out.writerows(rows)


def _thinned(path: Local) -> tuple[np.ndarray, np.ndarray]:
    """A path on the coarse nodes, as a start."""
    old, new = np.linspace(0, 1, len(path.x)), np.linspace(0, 1, 2 * INTERVALS + 1)
    return (
        np.column_stack([np.interp(new, old, c) for c in path.x.T]),
        np.column_stack([np.interp(new, old, c) for c in path.u.T]),
    )


if __name__ == "__main__":
    main()

"""Make the truth tables: choose facets, solve them by collocation, check them, write CSV.

Run from anywhere: ``nice python tests/truth/make_truth.py [table ...]``; see README.md beside it.
"""

from __future__ import annotations

import csv
import json
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import radau
from collocation import Answer, Local, best_over_starts, refine, solve, starts
from problem import Problem
from reflight import refly
from scipy.interpolate import RBFInterpolator
from shape import Shape, degree_two, least_ellipsoid, read_obj
from uniform import shape_sha256

HERE = Path(__file__).resolve().parent
SHAPES = HERE.parent.parent / "shapes"
INTERVALS = 40  # and the best again on twice as many, or more
UNDER_POLYHEDRON = 20  # the same where every node asks for a polyhedron's gravity
REFLOWN = 4  # of the facets under a polyhedron one in so many is flown again
SURVEY_INTERVALS = 30
SURVEY_STARTS = ("straight", "far", "right")
ENERGY_STARTS = ("straight", "far", "left", "right")
BINDS = 1e-3  # an ellipsoid multiplier (scaled) above this shapes the path

NORTH, EQUATOR, MIDDLE = (0.0, 0.0, 800.0), (800.0, 0.0, 0.0), (600.0, 0.0, 500.0)


# Facets of Bennu that the approach of `bennu_approach` reaches in two intervals.
APPROACHED = (167, 479, 872, 1299, 1652, 2459)

Chooser = Callable[["Case", np.random.Generator], list[int]]


@dataclass(frozen=True)
class Case:
    """One problem without its facet, and the shape its facets come from."""

    name: str
    problem: Problem
    shape: Shape


def bennu(name: str, r0: tuple[float, float, float], tof: float, **reading: str) -> Case:
    shape = read_obj(SHAPES / "bennu.obj")
    gravity = ("harmonics", 4.892, 246.0, *np.round(degree_two(shape, 246.0), 9))
    semi = tuple(np.ceil(least_ellipsoid(shape) * 1e3) / 1e3)
    omega = 2 * np.pi / (4.288 * 3600)
    problem = Problem(
        r0, (0.0, 0.0, 0.0), omega, gravity, 2000.0, 20.0, 400.0, tof, 200.0, semi, np.pi / 3, **reading
    )
    return Case(f"{name}_{tof:.0f}s", problem, shape)


def bennu_approach(tof: float) -> Case:
    """Head on at a speed that full thrust takes 684 m to stop; the keep-out zone begins 610 m away."""
    case = bennu("approach", (-1000.0, 0.0, 0.0), tof)
    moving = {"v0": (3.7, 0.0, 0.0), "semi_axes": (390.0, 380.0, 365.0)}
    return replace(case, problem=replace(case.problem, **moving))


def bacchus(tof: float, name: str = "north_pole", r0: tuple[float, float, float] = (0.0, 0.0, 600.0)) -> Case:
    shape = read_obj(SHAPES / "bacchus.obj")
    semi = tuple(np.ceil(least_ellipsoid(shape) * 1e3) / 1e3)
    omega, gravity = 2 * np.pi / (14.9 * 3600), ("dipole", 18.083, 0.437, 463.1)
    problem = Problem(r0, (0.0, 0.0, 0.0), omega, gravity, 2000.0, 20.0, 400.0, tof, 300.0, semi, np.pi / 3)
    return Case(f"bacchus_{name}_{tof:.0f}s", problem, shape)


def eros(tof: float, **reading: str) -> Case:
    shape = read_obj(SHAPES / "eros.obj")
    semi = tuple(np.ceil(least_ellipsoid(shape) * 1e1) / 1e1)
    gravity = ("dipole", 4.4628e5, 0.528, 15364.0)
    r0 = (0.0, 0.0, 16000.0)
    problem = Problem(
        r0, (0.0, 0.0, 0.0), 3.3117e-4, gravity, 1000.0, 20.0, 400.0, tof, 800.0, semi, np.pi / 3, **reading
    )
    return Case(f"eros_north_pole_{tof:.0f}s", problem, shape)


def eros_polyhedron(tof: float, name: str, r0: tuple[float, float, float]) -> Case:
    """Under the uniform polyhedron of the shape; the dipole is where its solution begins."""
    shape = read_obj(SHAPES / "eros.obj")
    semi = tuple(np.ceil(least_ellipsoid(shape) * 1e1) / 1e1)
    gravity = ("polyhedron", 4.4628e5, 0.528, 15364.0, "eros.obj", shape_sha256("eros.obj"))
    reading = {"final_mass": "flown"}
    problem = Problem(
        r0, (0.0, 0.0, 0.0), 3.3117e-4, gravity, 1000.0, 60.0, 310.0, tof, 300.0, semi, np.pi / 3, **reading
    )
    return Case(f"eros_{name}_{tof:.0f}s", problem, shape)


def survey_tau(case: Case, facet: int, rng: np.random.Generator) -> float:
    """A quick tau, for choosing facets only."""
    problem = case.problem.at(case.shape.centroids[facet], case.shape.normals[facet])
    found = starts(problem, SURVEY_INTERVALS, rng)
    names = SURVEY_STARTS[:1] if problem.gravity[0] == "polyhedron" else SURVEY_STARTS
    taus = [solve(problem, SURVEY_INTERVALS, "tau", *found[name], 1.2) for name in names]
    return min((t.tau for t in taus if t.solved), default=np.nan)


def predict(case: Case, known: dict[int, float]) -> np.ndarray:
    """Tau of every facet, interpolated over place and normal from the known ones."""
    place = case.shape.centroids / np.abs(case.shape.centroids).max()
    features = np.hstack([2 * place, case.shape.normals])
    facets = np.array([f for f, tau in known.items() if np.isfinite(tau)])
    values = np.array([known[f] for f in facets])
    return RBFInterpolator(features[facets], values, kernel="linear", neighbors=40)(features)


def near_boundary(count: int, far: int, survey: int = 90) -> Chooser:
    """Chooser: facets with tau nearest 1 after two rounds of prediction, and some far ones."""

    def choose(case: Case, rng: np.random.Generator) -> list[int]:
        total = len(case.shape.faces)
        known = {int(f): survey_tau(case, f, rng) for f in rng.choice(total, survey, replace=False)}
        for extra in (count, 2 * count):
            guess = predict(case, known)
            guess[list(known)] = np.inf
            for f in np.argsort(np.abs(guess - 1))[:extra]:
                known[int(f)] = survey_tau(case, int(f), rng)
        solved = sorted((f for f in known if np.isfinite(known[f])), key=lambda f: abs(known[f] - 1))
        others = [f for f in solved[count:] if abs(known[f] - 1) > 0.1]
        return solved[:count] + [int(f) for f in rng.choice(others, min(far, len(others)), replace=False)]

    return choose


def far_side(count: int) -> Chooser:
    """Chooser: facets that the start does not see, where the ellipsoid should bind."""

    def choose(case: Case, rng: np.random.Generator) -> list[int]:
        r0 = np.array(case.problem.r0) / case.problem.length
        centroids = case.shape.centroids
        cosine = centroids @ r0 / np.linalg.norm(centroids, axis=1)
        return [int(f) for f in rng.choice(np.flatnonzero(cosine < -0.1), count, replace=False)]

    return choose


def spread(near: int, rest: int) -> Chooser:
    """Chooser: some facets near the boundary and the rest anywhere."""

    def choose(case: Case, rng: np.random.Generator) -> list[int]:
        chosen = near_boundary(near, 0, survey=40)(case, rng)
        others = np.setdiff1d(np.arange(len(case.shape.faces)), chosen)
        return chosen + [int(f) for f in rng.choice(others, rest, replace=False)]

    return choose


def these(*facets: int) -> Chooser:
    """Chooser: facets that were chosen by hand."""
    return lambda case, rng: list(facets)


def tables() -> dict[str, Callable[[], list[tuple[Case, Chooser]]]]:
    """The tables by name: cases and how their facets are chosen."""
    places = {"north_pole": NORTH, "equator": EQUATOR, "mid_latitude": MIDDLE}

    def over_bennu(tof: float, chooser: Chooser, **reading: str) -> list[tuple[Case, Chooser]]:
        return [(bennu(name, r0, tof, **reading), chooser) for name, r0 in places.items()]

    paper = {"handover": "on_ellipsoid", "final_thrust": "paper"}
    return {
        "bennu_700s": lambda: over_bennu(700.0, near_boundary(26, 8)),
        "bennu_800s": lambda: over_bennu(800.0, near_boundary(14, 0)),
        "bennu_900s": lambda: over_bennu(900.0, far_side(26)),
        "bennu_on_ellipsoid": lambda: (
            over_bennu(900.0, spread(5, 3), handover="on_ellipsoid")[:2]
            + over_bennu(700.0, spread(5, 3), handover="on_ellipsoid")[2:]
        ),
        "bennu_paper_thrust": lambda: over_bennu(700.0, spread(5, 3), final_thrust="paper"),
        "bennu_paper": lambda: over_bennu(900.0, spread(5, 3), **paper),
        # reachable early, not in between, and later again
        "bennu_approach": lambda: [
            (bennu_approach(tof), these(*APPROACHED)) for tof in (425.0, 500.0, 650.0, 800.0)
        ],
        "bacchus": lambda: [(bacchus(900.0), near_boundary(12, 4)), (bacchus(1600.0), far_side(12))],
        "bacchus_boundary": lambda: [
            (bacchus(900.0), near_boundary(20, 0, survey=60)),
            (bacchus(1000.0, "equator", (1000.0, 0.0, 0.0)), near_boundary(20, 0, survey=60)),
            (bacchus(900.0, "mid_latitude", (400.0, 0.0, 600.0)), near_boundary(20, 0, survey=60)),
        ],
        "eros_boundary": lambda: [
            (eros_polyhedron(1500.0, "north_pole", (0.0, 0.0, 11000.0)), near_boundary(30, 0, survey=60))
        ],
        "eros_boundary_broadside": lambda: [
            (eros_polyhedron(1500.0, "broadside", (0.0, -14000.0, 0.0)), near_boundary(30, 0, survey=60))
        ],
        "eros_boundary_oblique": lambda: [
            (eros_polyhedron(1500.0, "oblique", (9000.0, 0.0, 10000.0)), near_boundary(20, 0, survey=40))
        ],
        "eros": lambda: [(eros(2500.0), near_boundary(16, 8))],
        "eros_flown_mass": lambda: [(eros(2500.0, final_mass="flown"), near_boundary(16, 8))],
    }


COLUMNS = [
    "case", "facet", "r_c_x_m", "r_c_y_m", "r_c_z_m", "n_x", "n_y", "n_z", "tau", "tau_half", "tau_radau",
    "tau_starts", "tau_ellipsoid_binds", "j_m2_s3", "j_half", "j_radau", "j_starts", "j_ellipsoid_binds",
    "j_ellipsoid_margin", "j_peak_ratio", "reflight_position_m", "reflight_velocity_m_s",
    "gravity_error",
]  # fmt: skip


def row_of(case: Case, facet: int, rng: np.random.Generator) -> dict[str, object]:
    """Solve one facet in both modes and check it; empty cells where there is no answer."""
    centroid, normal = case.shape.centroids[facet].round(6), case.shape.normals[facet].round(12)
    problem = case.problem.at(centroid, normal)
    row: dict[str, object] = dict.fromkeys(COLUMNS, "")
    row |= {"case": case.name, "facet": facet}
    row |= dict(zip(COLUMNS[2:8], [*problem.r_c, *problem.normal], strict=True))
    polyhedron = problem.gravity[0] == "polyhedron"
    least = best_over_starts(problem, UNDER_POLYHEDRON if polyhedron else INTERVALS, "tau", rng)
    row["tau_starts"] = least.statuses
    if least.best is None:
        return row
    row |= {"tau": f"{least.best.tau:.7f}", "tau_half": f"{least.half.tau:.7f}"}
    row["tau_ellipsoid_binds"] = int(least.best.ellipsoid_force > BINDS)
    if polyhedron:
        row["gravity_error"] = f"{least.gravity_error:.1e}"
        return row if facet % REFLOWN else row | flown_again(refly(problem, least.best))
    row["tau_radau"] = checked(radau.solve(problem, INTERVALS, "tau", least.best), 1)
    flown = refly(problem, least.best)
    if least.best.tau < 1:
        best = least_energy(problem, least.best, rng)
        row["j_starts"] = best.statuses
        if best.best is not None:
            row |= {"j_m2_s3": f"{best.best.j:.9e}", "j_half": f"{best.half.j:.9e}"}
            row["j_radau"] = checked(radau.solve(problem, INTERVALS, "j", best.best), 2)
            row["j_ellipsoid_binds"] = int(best.best.ellipsoid_force > BINDS)
            row["j_ellipsoid_margin"] = f"{best.best.margin:.3e}"
            row["j_peak_ratio"] = f"{np.linalg.norm(best.best.u, axis=1).max():.5f}"
            flown = refly(problem, best.best)
    return row | flown_again(flown)


def flown_again(flown: dict[str, float]) -> dict[str, object]:
    """What the flight of the control misses at the handover."""
    return {f"reflight_{name}": f"{flown[name]:.1e}" for name in ("position_m", "velocity_m_s")}


def least_energy(problem: Problem, least: Local, rng: np.random.Generator) -> Answer:
    """Least J at full thrust, from the usual starts and from the path of least thrust level."""
    extra = {"tau": refine(least, INTERVALS)}
    return best_over_starts(problem, INTERVALS, "j", rng, extra, ENERGY_STARTS)


def checked(answer: tuple[str, float, float], which: int) -> str:
    """The second method's number, or nothing if it did not converge."""
    if answer[0] not in ("Solve_Succeeded", "Solved_To_Acceptable_Level"):
        return ""
    return f"{answer[which]:.7f}" if which == 1 else f"{answer[which]:.9e}"


def header(case: Case) -> str:
    """One comment line with every physical input of the case, SI."""
    inputs = asdict(replace(case.problem, r_c=(), normal=()))
    del inputs["r_c"], inputs["normal"]
    return "# " + json.dumps({"case": case.name, **inputs})


def make(name: str) -> None:
    """Write one table, anew after each facet."""
    cases = tables()[name]()
    rng = np.random.default_rng(20221012)
    rows = []
    for case, chooser in cases:
        begun = time.process_time()
        facets = sorted(set(chooser(case, rng)))
        for facet in facets:
            rows.append(row_of(case, facet, rng))
            write(name, cases, rows)
        print(
            f"{name} {case.name}: {len(facets)} facets, {time.process_time() - begun:.0f} s CPU", flush=True
        )


def write(name: str, cases: list[tuple[Case, Chooser]], rows: list[dict[str, object]]) -> None:
    """Header lines for the cases that have rows, then the rows."""
    done = {row["case"] for row in rows}
    with (HERE / f"{name}.csv").open("w", newline="") as file:
        file.writelines(header(case) + "\n" for case, _ in cases if case.name in done)
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    for wanted in sys.argv[1:] or list(tables()):
        make(wanted)

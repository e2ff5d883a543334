"""The polyhedron's field, interpolated around Eros: how exact it is, what it costs, and what it changes."""

# ruff: noqa: E501 (lines of the page)

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from validation_text import exact, percent, spread, table

from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.body.gravity.surrounding_kernels import ERROR
from landing_cli.body.mesh import Mesh, facet_centroids, facet_normals
from landing_cli.reach.cases import landing_cases
from landing_cli.reach.free_descent import prepare, solve_prepared, survey
from landing_cli.reach.least_thrust import with_margin
from landing_cli.reach.pipeline import RunOptions, run
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import ReachRun
from landing_cli.reach.verify import verify_run
from landing_cli.scenario.build import build
from landing_cli.scenario.load import load

ROOT = Path(__file__).resolve().parent.parent
EROS = str(ROOT / "configs" / "eros.yaml")
INTERPOLATED = "body.gravity.model=interpolated"
TOF_S = 1500
START = "reach.initial_states=[{name: north_pole, position_km: [0, 0, 11]}]"
HEIGHTS_M, DISTANCES_M = (0.0, 10.0, 100.0, 500.0, 2000.0), (20e3, 36e3, 60e3, 1000e3)
POINTS, FACETS, EXACT_FACETS, ROUNDS = 1000, 240, 6, 2

Floats = NDArray[np.float64]


def polyhedral_gravity(eros: ReachRun, options: RunOptions, say: Callable[[str], None]) -> str:
    """The section on the interpolated field; Eros under its dipole is given, under the polyhedron it is solved here."""
    loaded = load(EROS, [INTERPOLATED, f"reach.tof_s=[{TOF_S}]", START])
    output = ROOT / "runs" / "eros-interpolated.h5"
    fitted = run(loaded, output, options, lambda done, total: None, say).run
    asteroid = fitted.cases[0].case.asteroid
    known = polyhedron_field(asteroid.mesh.vertices, asteroid.mesh.faces, asteroid.gm_m3_s2)
    where = ("points", "largest error over the polyhedron's pull", "median")
    changes = (
        "case",
        "reachable, dipole",
        "reachable, interpolated",
        "verdicts that differ",
        "unreachable proved, dipole",
        "interpolated",
        "miss under the polyhedron, dipole: median / worst, m",
        "interpolated, m",
    )
    costs = ("field", "CPU a facet, ms")
    levels = (
        "field",
        "tau, min / median / max",
        "not found",
        "tau < 1 and not reachable, or the reverse",
        "tau less the dipole's, 5 % / median / 95 %",
        "CPU a facet, ms",
    )
    return f"""## 17. The gravity of a polyhedron

`body.gravity.model: interpolated` flies in the field of the shape as a uniform polyhedron, through a fit: facets near
a cube of space are evaluated as they are, all others are a polynomial of degree 10, and from two radii outwards one
expansion of degree 14 holds. For `shapes/eros.obj` the fit has {len(asteroid.gravity.params) * 8 / 1e6:.0f} MB; its largest error at points that it did not
see is {exact(float(asteroid.gravity.params[ERROR]))}. Against the polyhedron itself, at random points:

{table(where, _errors(asteroid.gravity, known, asteroid.mesh))}

{FACETS} random facets of north_pole_{TOF_S}s, solved in turn under each field ({EXACT_FACETS} of them under the polyhedron), best of {ROUNDS}:

{table(costs, _costs())}

What it changes there; the misses are those of section 3:

{table(changes, _changes(eros, fitted))}

The least thrust levels tau (`reach.margin: true`) of the {FACETS} facets:

{table(levels, _levels(eros, fitted))}
"""


def _errors(field: GravityField, known: GravityField, mesh: Mesh) -> list[tuple[str, str, str]]:
    rng = np.random.default_rng(17)
    chosen = rng.choice(len(mesh.faces), POINTS)
    at, up = facet_centroids(mesh)[chosen], facet_normals(mesh)[chosen]
    around = rng.normal(size=(POINTS, 3))
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    places = {f"{h:.0f} m over a facet": at + h * up for h in HEIGHTS_M}
    places |= {f"{d / 1e3:.0f} km from the centre": d * around for d in DISTANCES_M}
    rows = []
    for name, points in places.items():
        pull = accelerations(known, points)
        wrong = np.linalg.norm(accelerations(field, points) - pull, axis=1) / np.linalg.norm(pull, axis=1)
        rows.append((name, exact(wrong.max()), exact(float(np.median(wrong)))))
    return rows


def _costs() -> list[tuple[str, str]]:
    prepared = {}
    for model in ("dipole", "interpolated", "polyhedron"):
        loaded = load(EROS, [f"body.gravity.model={model}", f"reach.tof_s=[{TOF_S}]"])
        assert loaded.scenario.reach is not None
        case = landing_cases(loaded.scenario.reach, build(loaded))[0][1]
        prepared[model] = prepare(case, survey(case))
    facets = _sample(len(case.asteroid.mesh.faces))
    spent: dict[str, list[float]] = {model: [] for model in prepared}
    for _ in range(ROUNDS):
        for model, of_model in prepared.items():
            asked = facets[:EXACT_FACETS] if model == "polyhedron" else facets
            begun = time.process_time()
            solve_prepared(of_model, asked)
            spent[model].append((time.process_time() - begun) / len(asked))
    return [(model, f"{1e3 * min(times):.2f}") for model, times in spent.items()]


def _levels(eros: ReachRun, fitted: ReachRun) -> list[tuple[object, ...]]:
    """Margins of the sampled facets under both fields."""
    fit = fitted.cases[0].case
    dipole = next(c.case for c in eros.cases if c.case.name == fit.name)
    facets = _sample(len(fit.asteroid.mesh.faces))
    rows: list[tuple[object, ...]] = []
    first = None
    for model, case in (("dipole", dipole), ("interpolated", fit)):
        prepared = prepare(case, survey(case))
        begun = time.process_time()
        found = with_margin(prepared, solve_prepared(prepared, facets)).rows
        spent_ms = 1e3 * (time.process_time() - begun) / len(facets)
        level = 1.0 - found["thrust_margin"]
        known = np.isfinite(level)
        wrong = known & ((level <= 1.0) != (found["verdict"] == Verdict.REACHABLE))
        first = level if first is None else first
        apart = (level - first)[np.isfinite(level - first)]
        moved = (
            "-" if model == "dipole" else " / ".join(f"{x:+.3f}" for x in np.percentile(apart, [5, 50, 95]))
        )
        rows.append(
            (model, spread(level, "{:.3f}"), int((~known).sum()), int(wrong.sum()), moved, f"{spent_ms:.1f}")
        )
    return rows


def _sample(facets: int) -> NDArray[np.int64]:
    return np.random.default_rng(3).choice(facets, FACETS, replace=False)


def _changes(eros: ReachRun, fitted: ReachRun) -> list[tuple[object, ...]]:
    rows = []
    for result in fitted.cases:
        name = result.case.name
        old = next(c for c in eros.cases if c.case.name == name)
        verdicts = [r.solutions.rows["verdict"] for r in (old, result)]
        misses = [verify_run((r,), jobs=2)[0].polyhedron for r in (old, result)]
        rows.append(
            (
                name,
                *(int((v == Verdict.REACHABLE).sum()) for v in verdicts),
                int((verdicts[0] != verdicts[1]).sum()),
                *(percent(r.summary["proved"], r.summary["unreachable"]) for r in (old, result)),
                *("-" if m is None else f"{m.median_m:.3g} / {m.worst_m:.3g}" for m in misses),
            )
        )
    return rows

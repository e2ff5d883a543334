"""The navigation error itself against the paper's steering, at equal energy, field by field."""

# ruff: noqa: E501 (lines of the page)

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from validation_text import spread, table

from landing_cli.observe.features import ThomasField, thomas_landmarks
from landing_cli.observe.observed import ObservedPath
from landing_cli.observe.pareto import EqualEnergy, compare_at_equal_energy
from landing_cli.observe.pipeline import ground_of, request_of
from landing_cli.observe.tasks import Ground
from landing_cli.scenario.load import load

SCENARIO = Path(__file__).resolve().parent.parent / "configs" / "published" / "shen2026-eros.yaml"
SEEDS = range(1, 11)
COUNTS = (1, 3, 7)
KNOTS = 5
FIELD = {"clusters": 3, "mean_per_cluster": 15.0, "spread_m": 12.0, "extent_m": 70.0}


def information_study() -> str:
    """The seeds' table, and what it comes to."""
    ground = ground_of(request_of(load(str(SCENARIO), ["observe.gravity=interpolated"])))
    fields = {seed: _field(ground, seed) for seed in SEEDS}
    pairs = [pair for _, compared in fields.values() for pair in compared]
    ratios = np.array([pair.sigma_ratio for pair in pairs])
    worse = sum(
        pair.paper.sigma.mean_m > least.sigma.mean_m
        for least, compared in fields.values()
        for pair in compared
    )
    energies = _energies(fields)
    return f"""### The navigation error itself

{len(fields)} random fields of landmarks ({FIELD["clusters"]} clusters of {FIELD["mean_per_cluster"]:g} on average, {FIELD["spread_m"]:g} m wide, within {FIELD["extent_m"]:g} m of the site; seed by
seed) in the same scenario. The paper's method steers with m waypoints; beside it stands the path of least J/J0 + lambda
log(mean position sigma) over {KNOTS} spline knots, with the weight lambda at which it spends no more than the paper's path.
J in units of the least-energy path's, mean position sigma in m by the filter with the sensor's true limits.

{_rows(fields)}

The informed path knows better in {int((ratios < 1.0).sum())} of {len(pairs)} pairs; its sigma over the paper's is {spread(ratios, "{:.2f}")} (least / median / greatest).
The paper's path knows worse than the unsteered least-energy path in {worse}. To know as well as the paper's path, the
informed one spends {spread(energies, "{:.2f}")} of the energy that the paper's path adds to the least.
"""


def _field(ground: Ground, seed: int) -> tuple[ObservedPath, list[EqualEnergy]]:
    """Compare on one field of landmarks, in the interpolated field of the polyhedron."""
    case = ground.solver_case
    landmarks = thomas_landmarks(case.asteroid.mesh, case.surface, case.frame, ThomasField(seed, **FIELD))
    return compare_at_equal_energy(
        replace(case, landmarks=landmarks), replace(ground.ways[0], control_points_m=None), COUNTS, KNOTS
    )


def _rows(fields: dict[int, tuple[ObservedPath, list[EqualEnergy]]]) -> str:
    rows = [
        (
            f"{seed} ({pair.paper.seen.visible.shape[1]})",
            pair.waypoints,
            f"{least.sigma.mean_m:.3f}",
            f"{pair.paper.path.performance_index_m2_s3 / least.path.performance_index_m2_s3:.4f}",
            f"{pair.paper.sigma.mean_m:.3f}",
            f"{pair.informed.path.performance_index_m2_s3 / least.path.performance_index_m2_s3:.4f}",
            f"{pair.informed.sigma.mean_m:.3f}",
            f"{pair.weight:.3g}",
            f"{pair.sigma_ratio:.2f}",
        )
        for seed, (least, compared) in fields.items()
        for pair in compared
    ]
    columns = ("seed (landmarks)", "m", "sigma unsteered", "J, paper", "sigma, paper")
    return table((*columns, "J, informed", "sigma, informed", "lambda", "ratio of sigmas"), rows)


def _energies(fields: dict[int, tuple[ObservedPath, list[EqualEnergy]]]) -> list[float]:
    """Energy added for the paper's sigma, over what the paper's path adds."""
    shares = []
    for least, compared in fields.values():
        unit = least.path.performance_index_m2_s3
        for pair in compared:
            added = pair.paper.path.performance_index_m2_s3 - unit
            shares.append(max(pair.energy_for_sigma_m2_s3 - unit, 0.0) / added)
    return shares

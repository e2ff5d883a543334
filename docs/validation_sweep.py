"""A grid of domains, landing sites in order, and two runs side by side."""

# ruff: noqa: E501 (lines of the page)

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
from validation_domain import Runs
from validation_text import exact, percent, table

from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.mesh import Mesh, facet_areas, facet_centroids
from landing_cli.parallel.plan import WorkPlan
from landing_cli.reach.compare_runs import compare_runs, shared_cases
from landing_cli.reach.figures.difference import difference_figure
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import ReachRun
from landing_cli.results import plotting
from landing_cli.results.surface_map import map_surface
from landing_cli.studies.rank.exports import sites_table
from landing_cli.studies.rank.figures import rank_figure
from landing_cli.studies.rank.measures import roughness_m, slopes_deg
from landing_cli.studies.rank.score import Ranking, Wishes, check_weights, rank_sites
from landing_cli.studies.sweep.grid_pages import Quantity, grid_figures
from landing_cli.studies.sweep.pipeline import RunOptions, grid_of, run as run_sweep
from landing_cli.studies.sweep.records import SweepRun, kept_columns
from landing_cli.studies.sweep.verify import verify_run

OVER = ("reach.tof_s=600:1200:100", "spacecraft.thrust_max_n=10,20,40")


def grids_and_sites(
    runs: Runs, scenario: Path, output: Path, images: Path, say: Callable[[str], None]
) -> str:
    """Section 11: `reach sweep`, `reach rank` and `landing results diff` on Bennu."""
    options = RunOptions(WorkPlan(2), resume=True)
    swept = run_sweep(grid_of(str(scenario), (), OVER), output, options, lambda done, total: None, say).run
    ranking = rank_sites(runs["bennu"].cases[:1], Wishes(check_weights({}), top=5))
    weaker, stronger = (_as_reach(swept, thrust_n) for thrust_n in (10.0, 20.0))
    with plotting.style():
        areas = np.array([case.summary["reachable_area_m2"] for case in swept.cases])
        quantity = Quantity("area", "reachable area (1000 m²)", 1e-3 * areas)
        for _, figure in grid_figures(swept, quantity):
            plotting.write_png(figure, images / "reach-sweep.png")
        plotting.write_png(rank_figure(ranking), images / "reach-rank.png")
        shared = next(iter(shared_cases(weaker, stronger)))
        figure = difference_figure(stronger, shared, map_surface(stronger.asteroid.mesh))
        plotting.write_png(figure, images / "results-diff.png")
    return f"""## 15. Grids of domains, sites in order, runs side by side

**`reach sweep bennu.yaml --over {" --over ".join(OVER)}`**: {swept.grid.question.cells} cells from {len(swept.grid.states)} initial
states over {swept.grid.facets} facets. {_equal_to_run(swept, runs["bennu"])} {_exceptions(swept)}

{_areas(swept)}

![Reachable area over time of flight and thrust](images/reach-sweep.png)

{_again(swept)}

**`reach rank`** on the first case of section 1. {_closed_forms()} The five best sites, at least {ranking.spacing_m:.0f} m apart, of
{ranking.candidates.sum()} candidates; the margin is {ranking.margin}, the slope against the run's {ranking.gravity} gravity.
{_polyhedron(runs["bennu"], ranking)}

{_sites(ranking)}

![Landing sites by score](images/reach-rank.png)

**`landing results diff`** of 10 and 20 N at {shared.case.split("=")[1].split(",")[0]} s, facets gained and lost:

{_differences(weaker, stronger)}

![Facets gained and lost](images/results-diff.png)
"""


def _as_reach(swept: SweepRun, thrust_n: float) -> ReachRun:
    """The cells of one thrust at 700 s as a reach run whose cases are named alike for every thrust."""
    from dataclasses import replace

    cases = [case for case in swept.cases if case.at == {"tof_s": 700.0, "thrust_max_n": thrust_n}]
    results = [case.as_reach() for case in cases]
    names = [f"{result.initial_state},tof_s=700" for result in results]
    return ReachRun(
        tuple(
            replace(result, case=replace(result.case, name=name))
            for result, name in zip(results, names, strict=True)
        )
    )


def _equal_to_run(swept: SweepRun, run: ReachRun) -> str:
    """Compare the cells that section 1 solved too, bit for bit."""
    facets = equal = cases = 0
    for result in run.cases:
        at = {"tof_s": result.case.tof_s, "thrust_max_n": result.case.spacecraft.thrust_max_n}
        for case in swept.cases:
            if case.at == at and case.initial_state == result.initial_state:
                columns = kept_columns(result.solutions).items()
                same = [
                    (
                        case.columns[name].view("u1").reshape(len(own), -1)
                        == own.view("u1").reshape(len(own), -1)
                    )
                    for name, own in ((name, np.ascontiguousarray(own)) for name, own in columns)
                ]
                equal += int(np.all([part.all(axis=1) for part in same], axis=0).sum())
                facets += swept.grid.facets
                cases += 1
    return f"{cases} cases are those of section 1, solved by `reach run`: {equal} of their {facets} facets are equal bit for bit."


def _exceptions(swept: SweepRun) -> str:
    """More thrust can only help, as long as nothing else changes: count where it does not."""
    gone = asked = 0
    for weak in swept.cases:
        for strong in swept.cases:
            nearest = (weak.at["thrust_max_n"], strong.at["thrust_max_n"]) in pairwise((10.0, 20.0, 40.0))
            alike = weak.at["tof_s"] == strong.at["tof_s"] and weak.state == strong.state
            if nearest and alike:
                was = weak.columns["verdict"] == Verdict.REACHABLE
                gone += int((was & (strong.columns["verdict"] != Verdict.REACHABLE)).sum())
                asked += int(was.sum())
    return f"More thrust must not lose a facet: of {asked} facets reachable with less, {gone} are not with the next larger thrust."


def _areas(swept: SweepRun) -> str:
    total = facet_areas(swept.asteroid.mesh).sum()
    times = swept.grid.question.axes[0].values
    rows = []
    for state in swept.grid.states:
        for thrust in swept.grid.question.axes[1].values:
            own = [c for c in swept.cases if c.initial_state == state and c.at["thrust_max_n"] == thrust]
            shares = [percent(c.summary["reachable_area_m2"], total) for c in own]
            rows.append((f"{state}, {thrust:g} N", *shares))
    return table(("reachable share of the surface", *(f"{tof:g} s" for tof in times)), rows)


def _again(swept: SweepRun) -> str:
    reports = verify_run(swept.cases, jobs=2)
    faults = sum(len(r.faults) for r in reports)
    miss = max(r.worst["touchdown_miss_m"].value for r in reports if "touchdown_miss_m" in r.worst)
    return f"""`landing results verify` solves {len(reports)} cases again, spread over the grid, and flies what it finds: {faults} facets differ,
{sum(r.flown for r in reports)} flights miss by at most {exact(miss)} m, {sum(r.verified for r in reports)} of {len(reports)} cases verified."""


def _closed_forms() -> str:
    rng = np.random.default_rng(0)
    unit = rng.normal(size=(1000, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    axes, spin, gm = np.array([300.0, 250.0, 200.0]), 3e-4, 5.0
    points, normals = unit * axes, unit / axes
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    up = gm * points / np.linalg.norm(points, axis=1, keepdims=True) ** 3 - spin**2 * points * (1.0, 1.0, 0.0)
    cosine = (up * normals).sum(axis=1) / np.linalg.norm(up, axis=1)
    apart = np.abs(np.cos(np.radians(slopes_deg(points, normals, point_mass_field(gm), spin))) - cosine).max()
    x, y = (a.ravel() for a in np.meshgrid(np.arange(27.0), np.arange(27.0), indexing="ij"))
    corner = np.arange(27**2).reshape(27, 27)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    wave = Mesh(np.stack([x, y, 0.05 * np.sin(0.5 * np.pi * x)], axis=1), faces)
    middle = int(np.argmin(np.linalg.norm(facet_centroids(wave) - (13.0, 13.0, 0.0), axis=1)))
    found, known = roughness_m(wave, 12.0)[middle], 0.05 * np.sqrt(2.0 / 6.0)
    return f"""On a triaxial ellipsoid that spins about a point mass the cosine of the slope is within {exact(apart)} of its closed
form; the roughness of a sine over three wavelengths either way is {100 * abs(found / known - 1):.2g} % off that of the endless one."""


def _polyhedron(run: ReachRun, ranking: Ranking) -> str:
    other = rank_sites(run.cases[:1], Wishes(check_weights({}), top=5, gravity="polyhedron"))
    apart = np.nanmax(np.abs(other.measures["slope"] - ranking.measures["slope"]))
    kept = len(np.intersect1d(other.sites, ranking.sites))
    return f"Against the polyhedron's gravity slopes change by up to {apart:.1f} degrees, and {kept} of the five sites stay."


def _sites(ranking: Ranking) -> str:
    rows = [
        (
            f"{site['facet']}",
            f"{site['score']:.3f}",
            f"{site['margin']:.3f}",
            f"{site['delta_v_m_s']:.2f}",
            f"{site['slope_deg']:.1f}",
            f"{site['roughness_m']:.2f}",
        )
        for site in sites_table(ranking).rows()
    ]
    return table(("facet", "score", "margin", "delta-v, m/s", "slope, degrees", "roughness, m"), rows)


def _differences(weaker: ReachRun, stronger: ReachRun) -> str:
    rows = [
        (
            row["case"].split(",")[0],
            row["gained"],
            row["lost"],
            f"{row['area_gained_m2']:.4g}",
            f"{100 * row['j_change_median']:.1f} %" if row["j_change_median"] is not None else "-",
            row["binding_changed"],
        )
        for row in compare_runs(weaker, stronger)
    ]
    columns = ("initial state", "gained", "lost", "area gained, m²", "median change of J", "binds otherwise")
    return table(columns, rows)

"""Flights around rock (`terrain: require`): how many are found, what they cost, and who checks them."""

# ruff: noqa: E501 (lines of the page)

from __future__ import annotations

import csv
import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from validation_text import percent, table

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.bvh import build_surface_index
from landing_cli.body.clearance import signed_distances
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.cases import landing_cases
from landing_cli.reach.flown import flown_trajectory
from landing_cli.reach.free_descent import prepare, solve_facets, solve_prepared, survey
from landing_cli.reach.records import FacetSolutions, LandingCase, Verdict
from landing_cli.reach.reflight import measure_rows, survey_ground
from landing_cli.reach.stored import CaseResult
from landing_cli.results.plotting import BLUE, INK, RED, ROCK, add_title, new_figure, style, write_png
from landing_cli.results.surface_view import draw_path, draw_surface, label_axes, view_from
from landing_cli.scenario.build import build
from landing_cli.scenario.load import load
from landing_cli.scenario.sections import reach_section

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))
from truth.tables import (  # noqa: E402
    HERE,
    TruthCase,
    gravity_field,
    landing_case as truth_case,
    tetrahedra,
)

J, CLEARANCE = "performance_index_m2_s3", "terrain_clearance_min_m"
SHRUNK, STEEP_DEG = 0.7, 85.0
# scenario, what is changed, case, and every how many-th facet is asked
ASKED = (
    ("bacchus", "shrunk", "north_pole_900s", 16),
    ("bacchus", "shrunk", "equator_1100s", 16),
    ("bacchus", "shrunk", "mid_latitude_1600s", 16),
    ("eros", "shrunk", "broadside_1500s", 40),
    ("eros", "shrunk", "north_pole_2000s", 40),
    ("bennu", "steep", "north_pole_900s", 1),
)
FLOWN_BY_TRIMESH = 5  # flights of each case


def around_rock(image: Path) -> str:
    """Section 11: flights around rock, and the figure of one."""
    rows, checked, inside, drawn = [], 0, 0, None
    for scenario, change, name, every in ASKED:
        case = _case(scenario, change, name)
        row, result, before = _compare(scenario, change, case, every)
        rows.append(row)
        again = np.flatnonzero(np.isin(result.solutions.rows["facet"], before.solutions.rows["facet"]))
        again = again[result.solutions.rows["verdict"][again] == Verdict.REACHABLE]
        for place in again[np.unique(np.linspace(0, len(again) - 1, FLOWN_BY_TRIMESH).round().astype(int))]:
            count, cuts = _by_trimesh(result, int(result.solutions.rows["facet"][place]))
            checked, inside = checked + count, inside + cuts
        if drawn is None:
            drawn = _draw(before, result, image)
    columns = (
        "case",
        "facets asked",
        "reachable",
        "through rock",
        "of these now clear",
        "unreachable",
        "unresolved",
        "J more, least / median / p90 / worst",
        "deepest, m",
        "CPU a facet through rock",
    )
    boulder_columns = (
        "boulder",
        "J through it, of the truth",
        "past it, of the truth",
        "ours over the truth, less 1",
    )
    return f"""## 16. Around rock

With `terrain: require` a facet whose best flight cuts rock is asked again, between planes off the terrain. The
shipped scenarios have no such facet: outside the ellipsoid that holds the body there is no rock, and the cone of 60
degrees keeps the final stage off it. So two of them are asked with an ellipsoid of {SHRUNK:g} times the semi-axes ("shrunk"; the
ends of the body stand out of it), Bennu with a half-angle of {STEEP_DEG:g} degrees ("steep"). "Deepest" is the greatest depth in
rock along flights flown again by the integrator of `landing results verify`; below 0 it is the least clearance beyond one mean
edge from the touchdown. J below 0 % more is a flight around rock that is cheaper than the one through it: the search
without walls had led another way about the ellipsoid.

{table(columns, rows)}

A sample of these flights, flown by DOP853 and looked at by trimesh's ray casting: {inside} of {checked} points lie inside the mesh.

Past a sphere, against direct collocation that keeps out of the sphere itself (`tests/truth/terrain/boulder.csv`):

{table(boulder_columns, _boulders())}

{drawn}

![The flight to a facet behind an end of Bacchus, before and after](images/{image.name})
"""


def _case(scenario: str, change: str, name: str) -> LandingCase:
    loaded = load(str(ROOT / "configs" / f"{scenario}.yaml"))
    case = next(c for _, c in landing_cases(reach_section(loaded), build(loaded)) if c.name == name)
    if change == "shrunk":
        return replace(case, ellipsoid_m=SHRUNK * case.ellipsoid_m)
    return replace(case, glide_slope_half_angle_rad=np.radians(STEEP_DEG))


def _compare(
    scenario: str, change: str, case: LandingCase, every: int
) -> tuple[tuple[object, ...], CaseResult, CaseResult]:
    """Solve without and with the terrain in the way: a row of the table, and the facets through rock."""
    shared = survey(case)
    facets = np.arange(0, len(case.asteroid.mesh.faces), every)
    report = solve_prepared(prepare(case, shared), facets)
    reachable = report.rows["verdict"] == Verdict.REACHABLE
    cut = reachable & (report.rows[CLEARANCE] < 0.0)
    strict = replace(case, terrain="require")
    prepared = prepare(strict, shared)
    solve_prepared(prepared, facets[cut][:1])  # compiled
    begin = time.process_time()
    require = solve_prepared(prepared, facets[cut])
    seconds = time.process_time() - begin
    verdicts = require.rows["verdict"]
    again = verdicts == Verdict.REACHABLE
    more = 100.0 * (require.rows[J][again] / report.rows[J][cut][again] - 1.0)
    measured = measure_rows(strict, require, np.flatnonzero(again), survey_ground(case.asteroid.mesh))
    dear = " / ".join(f"{p:.2g}" for p in np.percentile(more, (0, 50, 90, 100))) if len(more) else "-"
    row = (
        f"{scenario} {case.name}, {change}",
        len(facets),
        int(reachable.sum()),
        int(cut.sum()),
        f"{again.sum()} ({percent(again.sum(), cut.sum())})",
        int((verdicts == Verdict.UNREACHABLE).sum()),
        int((verdicts == Verdict.UNRESOLVED).sum()),
        f"{dear} %",
        f"{np.max(-measured[CLEARANCE], initial=-np.inf):.2g}",
        f"{1e3 * seconds / max(1, cut.sum()):.0f} ms",
    )
    nodes = np.concatenate([np.zeros((0, 3)), *(report.nodes_of(k) for k in np.flatnonzero(cut))])
    before = FacetSolutions(report.rows[cut], nodes.reshape(-1, 3))
    return row, CaseResult(strict, case.name, require), CaseResult(case, case.name, before)


def _by_trimesh(result: CaseResult, facet: int) -> tuple[int, int]:
    """Points of a flight by DOP853, and how many of them lie inside the mesh for trimesh."""
    path = flown_trajectory(result, facet).position_m[:-1]
    mesh = result.case.asteroid.mesh
    inside = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).contains(path)
    return len(path), int(inside.sum())


def _boulders() -> list[tuple[object, ...]]:
    lines = (HERE / "terrain" / "boulder.csv").read_text().splitlines()
    headers = {h["case"]: h for h in (json.loads(line[2:]) for line in lines if line.startswith("# "))}
    rows = []
    for known in csv.DictReader(line for line in lines if not line.startswith("# ")):
        given, j_free, j = headers[known["case"]], float(known["j_free_m2_s3"]), float(known["j_m2_s3"])
        found = _past(given)
        rows.append(
            (
                known["case"],
                f"{j_free:.5g}",
                f"{j:.5g} ({100 * (j / j_free - 1):+.1f} %)",
                f"{found / j - 1:+.1e}",
            )
        )
    return rows


def _past(given: dict[str, object]) -> float:
    """Our J past a boulder."""
    centroids, normals = np.array([given["r_c"]]), np.array([given["normal"]])
    nothing = np.ones(1)
    truth = TruthCase("boulder", given, nothing, centroids, normals, nothing, nothing, nothing, nothing)
    plain, facets = truth_case(truth)
    *centre, radius_m = given["boulder"]
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=radius_m)
    ground = tetrahedra(centroids, normals)[0]
    vertices = np.concatenate([ground.vertices, np.asarray(sphere.vertices) + centre])
    mesh = replace(
        ground, vertices=vertices, faces=np.concatenate([ground.faces, sphere.faces + len(ground.vertices)])
    )
    body = Asteroid("boulder", mesh, given["omega"], gravity_field(given["gravity"]), given["gravity"][1])
    craft = Spacecraft(given["mass"], given["thrust"], given["isp"])
    case = replace(plain, asteroid=body, spacecraft=craft, terrain="require")
    return float(solve_facets(case, facets).rows[J][0])


def _draw(before: CaseResult, after: CaseResult, image: Path) -> str:
    """Draw the flight that is led farthest, before and after; say which it is."""
    mesh = before.case.asteroid.mesh
    clear = after.solutions.rows["verdict"] == Verdict.REACHABLE
    place = int(np.argmin(np.where(clear, before.solutions.rows[CLEARANCE], np.inf)))
    facet = int(before.solutions.rows["facet"][place])
    paths = [flown_trajectory(result, facet, integrator="gauss") for result in (before, after)]
    sight = np.linalg.svd(paths[1].position_m, full_matrices=False)[2][2]
    middle = paths[1].position_m[len(paths[1].t_s) // 2]
    aside = middle - paths[0].position_m[len(paths[0].t_s) // 2]
    view = view_from(sight if sight @ aside >= 0.0 else -sight)
    surface = build_surface_index(mesh)
    with style():
        figure = new_figure(9.0, 4.4)
        axes = figure.add_axes((0.06, 0.13, 0.44, 0.68))
        draw_surface(axes, mesh, view, np.tile([[0.80, 0.775, 0.735]], (len(mesh.faces), 1)))
        beside = figure.add_axes((0.60, 0.15, 0.38, 0.62))
        for path, colour, label in zip(paths, (RED, BLUE), ("report", "require"), strict=True):
            draw_path(axes, mesh, view, path.position_m, color=colour, lw=1.6, zorder=4)
            beside.plot(
                path.t_s, signed_distances(surface, path.position_m), color=colour, label=f"terrain: {label}"
            )
        axes.plot(*view.flat(paths[1].position_m[-1]), "o", color=INK, ms=4, zorder=6)
        points = np.concatenate([view.flat(mesh.vertices), *(view.flat(p.position_m) for p in paths)])
        low, high = points.min(axis=0), points.max(axis=0)
        centre, half = 0.5 * (low + high), 0.55 * float((high - low).max())
        axes.set(xlim=(centre[0] - half, centre[0] + half), ylim=(centre[1] - half, centre[1] + half))
        axes.set_aspect("equal")
        axes.set_title("a  paths over the mesh (dotted: behind it or in it)")
        label_axes(axes, view)
        beside.axhspan(beside.get_ylim()[0], 0.0, color=ROCK, lw=0)
        beside.set(
            xlabel="time (s)", ylabel="distance to the surface (m)", title="b  what is between them and rock"
        )
        beside.set_xlim(0.0, before.case.tof_s)
        beside.grid(True)
        beside.legend(loc="upper right")
        deepest = -float(before.solutions.rows[CLEARANCE][place])
        more = 100.0 * (after.solutions.rows[J][place] / before.solutions.rows[J][place] - 1.0)
        add_title(
            figure,
            f"Bacchus, {before.case.name}: the flight to facet {facet}",
            f"the cheapest cuts {deepest:.0f} m deep into rock; around it costs {more:.1f} % more J",
        )
        write_png(figure, image)
    return f"Facet {facet} of {before.case.name}: the cheapest flight cuts {deepest:.0f} m deep; the one around costs {more:.1f} % more J."

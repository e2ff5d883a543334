"""Observed landings on Eros beside what Shen et al. (2026) print, and what explains the difference."""

# ruff: noqa: E501 (lines of the page)

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from validation_information import information_study
from validation_text import exact, table

from landing_cli.errors import InputRefused
from landing_cli.observe.observed import ObservedPath
from landing_cli.observe.pipeline import ground_of, request_of
from landing_cli.observe.records import Side, SteeringOptions
from landing_cli.observe.stored import ObservationEntry
from landing_cli.observe.tasks import Ground, ObserveTask, solve_task
from landing_cli.observe.verify import verify_path
from landing_cli.scenario.load import load
from landing_cli.sources.shape_search import find_shape

SCENARIO = Path(__file__).resolve().parent.parent / "configs" / "published" / "shen2026-eros.yaml"
PRINTED_M = ((-28.67, 71.88), (1.92, -21.90))  # Table 1: mu2, mu3
COUNTS = (0, 1, 3, 7, 15)
MANY = (1, 3, 7, 15, 31, 63)

ABSENT = """## 9. Landing where it sees

Not computed: the paper's case (`configs/published/shen2026-eros.yaml`) needs the NEAR plate model of 7790 facets, which
is not shipped (`LANDING_REFERENCE_DATA`).
"""


def observed_landings() -> str:
    """Section 9: the paper's method at its own control points, its limits, and the navigation error itself."""
    loaded = load(str(SCENARIO))
    try:
        find_shape(loaded.scenario.body.shape, SCENARIO.parent)
    except InputRefused:
        return ABSENT
    ground = ground_of(request_of(loaded))
    return f"""## 9. Landing where it sees

`configs/published/shen2026-eros.yaml`, beside Shen, Ge, Liang and Zhu (2026), "the paper" of this section. It prints the
initial position, the time of flight and the control points; site, landmarks, sensor and what is known beforehand are
ours, so that its figures can be compared in kind only. Its mesh is not shipped; what follows was computed with it.

### Control points

{_clusters(ground)}

### Waypoints

{_waypoints(ground)}

J never falls from one row to the next, because each set of waypoints holds the one before it. What is seen follows no
such rule: a path may be steered away from landmarks that it saw. The miss is that of the stored thrust flown open loop by
another integrator in the same gravity.

### Timing of the waypoints

{_timing(ground)}

With the control points of the paper's eq 10 the curve begins and ends at a speed that the path cannot have (it starts and
lands at rest), so J grows with every waypoint, by 2 sqrt(3) (|dv_0|^2 + |dv_f|^2) / t_f each in the limit.
`velocity_matched` repeats the end control points shifted by the velocities there, and J settles.

### Gravity

{_gravity()}

{information_study()}"""


def _solved(ground: Ground, way: SteeringOptions) -> tuple[ObservationEntry, float]:
    """Solve twice, for the time of the second."""
    task = ObserveTask(f"waypoints_{way.waypoints}", way)
    solve_task(ground, task)
    began = time.thread_time()
    observation = solve_task(ground, task)
    cpu_s = time.thread_time() - began
    return ObservationEntry(task.name, ground.case, observation, cpu_s), cpu_s


def _clusters(ground: Ground) -> str:
    clustering = ground.clustering
    sides: dict[int, Side] = {1: "left", -1: "right"}
    rows = [
        (f"mu{i + 1}", f"({x:.2f}, {y:.2f})", sides[int(side)])
        for i, ((x, y), side) in enumerate(zip(clustering.center_m, clustering.side, strict=True))
    ]
    track = ground.case.frame.to_site(ground.nominal.path.position_m)[:, :2]
    printed = []
    for x, y in PRINTED_M:
        nearest = int(np.argmin(np.linalg.norm(track - (x, y), axis=1)))
        way = track[min(nearest + 1, len(track) - 1)] - track[max(nearest - 1, 0)]
        offset = np.array([x, y]) - track[nearest]
        printed.append("left" if way[0] * offset[1] - way[1] * offset[0] > 0 else "right")
    told = table(("centre", "site frame, m", "side of the unsteered path"), rows)
    return f"""{told}

k = {len(clustering.center_m)} by the elbow. The printed mu2 = {PRINTED_M[0]} lies on the {printed[0]} of the unsteered path, the printed
mu3 = {PRINTED_M[1]} on the {printed[1]}: they cannot be steered to together, as the paper does; with y = +21.90, as its
figures show, both lie on one side."""


def _row(name: str, observed: ObservedPath, least: float, miss: str, cpu: str) -> tuple[str, ...]:
    path, seen = observed.path, observed.seen
    return (
        name,
        f"{path.performance_index_m2_s3:.10f}",
        f"{100 * (path.performance_index_m2_s3 / least - 1):+.3f} %",
        f"{100 * path.propellant_mass_fraction:.4f} %",
        f"{seen.distinct}",
        f"{seen.mean_in_view:.2f}",
        f"{seen.longest_gap_s:.0f}",
        f"{observed.sigma.mean_m:.4f}",
        miss,
        cpu,
    )


def _waypoints(ground: Ground) -> str:
    shared = ground.ways[0]
    rows, least = [], np.nan
    for m in COUNTS:
        entry, cpu_s = _solved(ground, replace(shared, waypoints=m))
        steered = entry.observation.steered
        if m == 0:
            least = steered.path.performance_index_m2_s3
            report = verify_path(ground.case, "nominal", ground.nominal)
            miss = exact(report.worst["touchdown_miss_m"].value)
            rows.append(_row("unsteered", ground.nominal, least, miss, "-"))
        report = verify_path(ground.case, entry.name, steered, entry.observation.waypoints)
        miss = exact(report.worst["touchdown_miss_m"].value)
        rows.append(_row(f"m = {m}", steered, least, miss, f"{cpu_s:.2f}"))
    columns = (
        "path",
        "J, m2/s3",
        "above m = 0",
        "PMF",
        "distinct",
        "in view",
        "gap, s",
        "sigma, m",
        "miss, m",
    )
    return table((*columns, "CPU, s"), rows)


def _timing(ground: Ground) -> str:
    shared = ground.ways[0]
    least = _index(ground, replace(shared, waypoints=0))
    rows = []
    for m in MANY:
        grown = [
            100 * (_index(ground, replace(shared, waypoints=m, timing=timing)) / least - 1)
            for timing in ("paper", "velocity_matched")
        ]
        rows.append((m, *(f"{value:+.4f} %" for value in grown)))
    return table(("m", "J above m = 0, paper", "velocity_matched"), rows)


def _index(ground: Ground, way: SteeringOptions) -> float:
    from landing_cli.observe.transcription import least_energy_path
    from landing_cli.observe.waypoints import waypoints_of

    tof_s = ground.nominal.path.tof_s
    points = waypoints_of(ground.case, ground.control_points_m, tof_s, way) if way.waypoints else None
    nodes = max(way.nodes, 8 * (way.waypoints + 1))
    return least_energy_path(ground.case, tof_s, points, nodes).performance_index_m2_s3


def _gravity() -> str:
    rows = []
    for gravity in ("polyhedron", "interpolated"):
        ground = ground_of(request_of(load(str(SCENARIO), [f"observe.gravity={gravity}"])))
        entry, cpu_s = _solved(ground, replace(ground.ways[0], waypoints=3))
        report = verify_path(ground.case, entry.name, entry.observation.steered)
        error = ground.gravity.get("gravity_error_relative")
        rows.append(
            (
                gravity,
                exact(float(error)) if isinstance(error, float) else "-",
                f"{entry.observation.steered.path.performance_index_m2_s3:.10f}",
                exact(report.worst["touchdown_miss_m"].value),
                f"{cpu_s:.2f}",
            )
        )
    return table(
        ("field, m = 3", "greatest relative error", "J, m2/s3", "miss in the polyhedron, m", "CPU, s"), rows
    )

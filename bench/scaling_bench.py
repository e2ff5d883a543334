"""How cost grows with the facets on one body: the traversal (CPU, memory) and the trace (solves, misses).

``python -m bench scaling`` refines the shipped Bennu by Loop subdivision, runs ``reach run`` on each mesh in
a process of its own and fits exponents: of the traversal's CPU, the whole run but its imports, and of the
trace's solves. The traversal's verdicts tell what the trace missed. ``--flat`` halves edges instead, which
keeps the facets of the coarse mesh as flat faces with sharp edges between them.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

# facets -> facets of the coarse mesh, and how often it is refined
REFINED = {2692: (2692, 0), 10768: (2692, 1), 49152: (3072, 2), 196608: (3072, 3)}
SCENARIO = ("reach.initial_states=[{name: north_pole, position_km: [0, 0, 0.8]}]",)


def refined_mesh(facets: int, flat: bool):
    """Bennu's shipped shape (or its resampling to the coarse number of facets), refined."""
    from trimesh.remesh import subdivide, subdivide_loop

    from landing_cli.body.mesh import Mesh
    from landing_cli.body.resample import resampled
    from landing_cli.scenario.build import build
    from landing_cli.scenario.load import load

    coarse, times = REFINED[facets]
    mesh = build(load("bennu.yaml")).asteroid.mesh
    if coarse != len(mesh.faces):
        mesh = resampled(mesh, coarse // 2 + 2)
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    refine = subdivide if flat else subdivide_loop
    for _ in range(times):
        vertices, faces = refine(vertices, faces)
    return Mesh(vertices, faces)


def write_obj(path: Path, mesh) -> None:
    """Write a mesh in km."""
    with path.open("w") as file:
        np.savetxt(file, mesh.vertices / 1000.0, fmt="v %.12g %.12g %.12g")
        np.savetxt(file, mesh.faces + 1, fmt="f %d %d %d")


def child(method: str, shape: str, tof_s: float, verdicts: str) -> None:
    """Run one method on one mesh, and print what it cost as JSON."""
    from landing_cli.parallel.blas import pin_blas_threads

    pin_blas_threads()
    import resource

    from landing_cli.parallel import WorkPlan
    from landing_cli.reach.pipeline import RunOptions, run
    from landing_cli.scenario.load import load

    overrides = [f"body.shape={shape}", f"reach.tof_s={tof_s}", f"reach.method={method}", *SCENARIO]
    loaded = load("bennu.yaml", overrides)
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        found = run(loaded, Path(folder) / "run.h5", RunOptions(WorkPlan(2)), lambda done, total: None).run
    cpu_s = time.process_time() - begun
    case = found.cases[0]
    if method == "traverse":
        domain = case.solutions.rows["verdict"] == 1
    else:
        domain = case.boundary.dataset("domain").data == 1
    np.save(verdicts, domain)
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"cpu_s": cpu_s, "peak_mb": peak_mb, **case.summary.get("trace", {})}))


def measured(method: str, shape: Path, tof_s: float) -> dict:
    """Run a method in a process of its own; the domain comes back as ``domain``."""
    with tempfile.TemporaryDirectory() as folder:
        verdicts = Path(folder) / "domain.npy"
        call = ["--child", method, str(shape), str(tof_s), str(verdicts)]
        run = [sys.executable, "-m", "bench.scaling_bench", *call]
        told = subprocess.run(run, capture_output=True, check=True, text=True).stdout
        return {**json.loads(told), "domain": np.load(verdicts)}


def misses(mesh, found: np.ndarray, truth: np.ndarray) -> tuple[int, int, float]:
    """Wrong facets, components of at least 3 facets of which all is wrong, wrong m2."""
    from landing_cli.body.adjacency import components, facet_neighbours
    from landing_cli.body.mesh import facet_areas
    from landing_cli.reach.traced import LEAST_COMPONENT

    wrong = found != truth
    label = components(facet_neighbours(mesh), truth)
    wholly = np.bincount(label, weights=~wrong) == 0
    missed = int((wholly & (np.bincount(label) >= LEAST_COMPONENT)).sum())
    return int(wrong.sum()), missed, float(facet_areas(mesh)[wrong].sum())


def exponent(sizes: list[int], values: list[float]) -> float:
    """Slope of the logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])


def measure(sizes: list[int], tof_s: float, flat: bool, traverse: bool = True) -> list[dict]:
    """One row a mesh: the traversal's cost, the trace's, and what it missed."""
    rows = []
    for facets in sizes:
        mesh = refined_mesh(facets, flat)
        with tempfile.TemporaryDirectory() as folder:
            shape = Path(folder) / f"bennu-{facets}.obj"
            write_obj(shape, mesh)
            row = {"facets": facets, "trace": measured("trace", shape, tof_s), "mesh": mesh}
            if traverse:
                row["traverse"] = measured("traverse", shape, tof_s)
                row["misses"] = misses(mesh, row["trace"]["domain"], row["traverse"]["domain"])
        rows.append(row)
    return rows


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(prog="python -m bench scaling", description=__doc__.splitlines()[0])
    parser.add_argument("--facets", nargs="+", type=int, default=list(REFINED), choices=list(REFINED))
    parser.add_argument("--tof", type=float, default=700.0, help="time of flight, s")
    parser.add_argument("--flat", action="store_true", help="halve edges instead of smoothing")
    parser.add_argument("--only-trace", action="store_true", help="no traversal, so no misses either")
    options = parser.parse_args()
    print(f"{'facets':>8s}{'traverse: CPU s':>17s}{'ms a facet':>12s}{'peak MB':>9s}", end="")
    print(f"{'trace: N':>10s}{'N/N_f':>8s}{'CPU s':>8s}{'peak MB':>9s}{'rounds':>8s}{'loops':>7s}", end="")
    print(f"{'wrong facets':>14s}{'components':>12s}{'m2':>8s}")
    rows = []
    for facets in options.facets:
        row = measure([facets], options.tof, options.flat, not options.only_trace)[0]
        rows.append(row)
        t = row.get("traverse")
        cost = (t["cpu_s"], 1e3 * t["cpu_s"] / facets, t["peak_mb"]) if t else (np.nan,) * 3
        print(f"{facets:8d}{cost[0]:17.2f}{cost[1]:12.3f}{cost[2]:9.0f}", end="")
        t = row["trace"]
        print(f"{t['N']:10d}{t['ratio']:8.2%}{t['cpu_s']:8.2f}{t['peak_mb']:9.0f}{t['rounds']:8d}", end="")
        wrong = row.get("misses", ("-", "-", np.nan))
        print(f"{t['loops']:7d}{wrong[0]:>14}{wrong[1]:>12}{wrong[2]:8.1f}", flush=True)
    if len(rows) > 1:
        sizes = [row["facets"] for row in rows]
        print(f"solves of the trace: exponent {exponent(sizes, [row['trace']['N'] for row in rows]):.3f}")
        if not options.only_trace:
            cpu = [row["traverse"]["cpu_s"] for row in rows]
            print(f"CPU of the traversal: exponent {exponent(sizes, cpu):.3f}", end="")
            print(f", from {sizes[-2]} to {sizes[-1]} facets {exponent(sizes[-2:], cpu[-2:]):.3f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2], sys.argv[3], float(sys.argv[4]), sys.argv[5])
    else:
        main()

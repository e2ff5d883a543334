"""CPU time of exact clearance: 200 path points and whole landing paths, small mesh to large.

Run ``python bench/clearance_bench.py``. It uses the shipped Eros shape where it finds it, else the reference
model in LANDING_REFERENCE_DATA/shapes (default ../shared/shapes), and a lumpy ellipsoid of 49,152 facets.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from landing_cli.body.adjacency import mean_edge_m
from landing_cli.body.bvh import build_surface_index
from landing_cli.body.clearance import TOUCHDOWN_TOLERANCE_M as TOLERANCE, path_clearance, signed_distances
from landing_cli.body.mesh import Mesh, facet_centroids

POINTS = 200
PATHS = 40


def eros() -> Mesh | None:
    """Read the Eros shape, in metres, where there is one."""
    import trimesh

    root = Path(__file__).resolve().parent.parent
    reference = Path(os.environ.get("LANDING_REFERENCE_DATA", root.parent / "shared")) / "shapes"
    for path in (root / "shapes" / "eros.obj", reference / "eros_near_3897.obj"):
        if path.is_file():
            loaded = trimesh.load(path, process=False)
            return Mesh(np.asarray(loaded.vertices) * 1000.0, np.asarray(loaded.faces))
    return None


def lumpy_ellipsoid(count: int) -> Mesh:
    """Build an ellipsoid with smooth lumps from `count` points of a Fibonacci lattice."""
    index = np.arange(count) + 0.5
    z = 1.0 - 2.0 * index / count
    angle = np.pi * (1.0 + np.sqrt(5.0)) * index
    ring = np.sqrt(1.0 - z**2)
    ball = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)
    faces = ConvexHull(ball).simplices
    a, b, c = np.moveaxis(ball[faces], 1, 0)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    lumps = 1.0 + 0.08 * np.sin(7 * ball[:, 0]) * np.cos(5 * ball[:, 1] + 1.0) * np.sin(6 * ball[:, 2] + 2.0)
    return Mesh(ball * lumps[:, None] * [16000.0, 8000.0, 6000.0], faces)


def landing_paths(mesh: Mesh) -> list[np.ndarray]:
    """Bend paths from 1.1 to 2 radii of the body down to random facets."""
    rng = np.random.default_rng(0)
    s = np.linspace(0.0, 1.0, POINTS)[:, None]
    radius = np.linalg.norm(mesh.vertices, axis=1).max()
    paths = []
    for touchdown in facet_centroids(mesh)[rng.integers(0, len(mesh.faces), PATHS)]:
        start = touchdown / np.linalg.norm(touchdown) + 0.3 * rng.normal(size=3)
        start *= rng.uniform(1.1, 2.0) * radius / np.linalg.norm(start)
        paths.append((1 - s) ** 2 * start + 1.3 * s * (1 - s) * (start + touchdown) + s**2 * touchdown)
    return paths


def cpu_ms(work: Callable[[np.ndarray], object], paths: list[np.ndarray]) -> tuple[float, float]:
    """Measure the mean and the worst CPU time of one call, ms, each the best of five rounds."""
    best = np.full(len(paths), np.inf)
    for _ in range(5):
        for i, path in enumerate(paths):
            start = time.process_time_ns()
            for _ in range(5):
                work(path)
            best[i] = min(best[i], (time.process_time_ns() - start) / 5e6)
    return float(best.mean()), float(best.max())


def report(name: str, mesh: Mesh) -> None:
    """Print the table of one mesh."""
    start = time.process_time()
    surface = build_surface_index(mesh)
    print(f"{name}, {len(mesh.faces)} facets: index built in {time.process_time() - start:.3f} s CPU")
    paths, edge, vertices = landing_paths(mesh), mean_edge_m(mesh), cKDTree(mesh.vertices)
    rows: list[tuple[str, Callable[[np.ndarray], object]]] = [
        (f"signed distance of {POINTS} points", lambda p: signed_distances(surface, p)),
        ("path clearance, points only", lambda p: path_clearance(surface, p, edge, TOLERANCE, np.inf)),
        (
            "path clearance, chords at edge/10",
            lambda p: path_clearance(surface, p, edge, TOLERANCE, edge / 10),
        ),
        ("nearest vertex (not a distance)", vertices.query),
    ]
    for label, work in rows:
        work(paths[0])  # compiled outside the clock
        mean, worst = cpu_ms(work, paths)
        print(f"  {label:36s} mean {mean:7.4f} ms, worst {worst:7.4f} ms CPU a path")
    error = max(float(np.max(vertices.query(p)[0] - np.abs(signed_distances(surface, p)))) for p in paths)
    print(f"  nearest vertex is wrong by up to     {error:.1f} m")


def main() -> None:
    """Print one table a mesh."""
    shape = eros()
    if shape is None:
        print("Eros: no shape found, skipped")
    else:
        report("Eros", shape)
    report("lumpy ellipsoid", lumpy_ellipsoid(24578))


if __name__ == "__main__":
    main()

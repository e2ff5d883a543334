"""CPU time of sight lines from landmarks, and who is right where ours and embree's differ.

Run ``python bench/ray_bench.py``. Rays run from the centroids of Eros facets to points some hundred metres
away, half of them above the facet's plane, down to grazing it.
"""

from __future__ import annotations

import time

import numpy as np

from bench.clearance_bench import eros, lumpy_ellipsoid
from landing_cli.body.bvh import build_surface_index
from landing_cli.body.mesh import Mesh, facet_centroids
from landing_cli.body.ray_cast import is_obstructed

RAYS = 100_000
OFFSET_M = 0.05  # at either end, as in landing_cli.observe.visibility
REACH_M = 300.0


def sight_lines(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Draw the ends of rays."""
    rng = np.random.default_rng(0)
    starts = facet_centroids(mesh)[rng.integers(0, len(mesh.faces), RAYS)]
    return starts, starts + rng.normal(0.0, REACH_M, (RAYS, 3))


def by_embree(mesh: Mesh, starts: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, float]:
    """Whether single-precision rays are stopped, and their CPU time, s."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene()
    TriangleMesh(scene, mesh.corners.astype(np.float32))
    length = np.linalg.norm(ends - starts, axis=1, keepdims=True)
    along = (ends - starts) / length
    first, reach = starts + OFFSET_M * along, length[:, 0] - 2.0 * OFFSET_M
    begin = time.process_time()
    hit = scene.run(*(x.astype(np.float32) for x in (first, along)), dists=reach.astype(np.float32))
    return hit >= 0, time.process_time() - begin


def by_every_facet(mesh: Mesh, start: np.ndarray, end: np.ndarray) -> bool:
    """Whether some facet stops a ray, by solving for the point on each."""
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    columns = np.stack([b - a, c - a, np.broadcast_to(start - end, a.shape)], axis=2)
    u, v, share = np.linalg.solve(columns, (start - a)[:, :, None])[:, :, 0].T
    away = share * np.linalg.norm(end - start)
    within = (away > OFFSET_M) & (away < np.linalg.norm(end - start) - OFFSET_M)
    return bool(((u >= 0) & (v >= 0) & (u + v <= 1) & within).any())


def report(name: str, mesh: Mesh) -> None:
    """Print the figures of one mesh."""
    surface = build_surface_index(mesh)
    starts, ends = sight_lines(mesh)
    is_obstructed(surface, starts[:1], ends[:1], OFFSET_M)  # compiled outside the clock
    begin = time.process_time()
    ours = is_obstructed(surface, starts, ends, OFFSET_M)
    seconds = time.process_time() - begin
    single, embree_seconds = by_embree(mesh, starts, ends)
    differ = np.flatnonzero(ours != single)
    truth = np.array([by_every_facet(mesh, starts[row], ends[row]) for row in differ], dtype=bool)
    print(f"{name}, {len(mesh.faces)} facets, {RAYS} rays, of which {np.count_nonzero(ours)} stopped")
    print(
        f"  double precision  {RAYS / seconds:9.3g} rays a CPU second, wrong {(ours[differ] != truth).sum()}"
    )
    print(f"  embree            {RAYS / embree_seconds:9.3g} rays a CPU second, ", end="")
    print(f"wrong {(single[differ] != truth).sum()} (where the two differ, every facet is asked)")


def main() -> None:
    """Print the figures of each mesh."""
    shape = eros()
    if shape is None:
        print("Eros: no shape found, skipped")
    else:
        report("Eros", shape)
    report("lumpy ellipsoid", lumpy_ellipsoid(24578))


if __name__ == "__main__":
    main()

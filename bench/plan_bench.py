"""CPU time of a Bezier plan beside the same search written with trimesh.proximity and numpy.

Run ``python bench/plan_bench.py``: the paper's case where its mesh is found in LANDING_REFERENCE_DATA/shapes
(default ../shared/shapes), else the same start and clearance over the shipped Eros shape. Both searches price
the same grids by the same rule and check candidates from the cheapest up; both have to find the same guide
points.
"""

from __future__ import annotations

import importlib.util
import math
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.bvh import build_surface_index
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.landing_site import Site
from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.plan.bezier import plan_bezier
from landing_cli.plan.grid_search import Found, search_guide_points
from landing_cli.plan.guide_candidates import GuideSearch, heights, prepare_search
from landing_cli.plan.pseudospectral import plan_pseudospectral
from landing_cli.plan.records import BezierOptions, PlanCase, PseudospectralOptions
from landing_cli.sources.shape_files import read_shape

GM = 4.4628e5
PUBLISHED_SITE_M = (-647.33, 6602.60, -1712.16)
ROUNDS = 20


def eros() -> tuple[str, PlanCase]:
    """Build the paper's case, on the mesh that is found."""
    root = Path(__file__).resolve().parent.parent
    reference = Path(os.environ.get("LANDING_REFERENCE_DATA", root.parent / "shared")) / "shapes"
    path = next(p for p in (reference / "eros_near_3897.obj", root / "shapes" / "eros.obj") if p.is_file())
    mesh = read_shape(path, "km").mesh
    facet = int(np.argmin(np.linalg.norm(facet_centroids(mesh) - PUBLISHED_SITE_M, axis=1)))
    case = PlanCase(
        name="nominal",
        asteroid=Asteroid("eros", mesh, 3.3117e-4, point_mass_field(GM), GM),
        spacecraft=Spacecraft(500.0, 60.0, 150.0),
        position_m=np.array([-32335.78, 13393.92, 0.0]),
        velocity_m_s=np.array([1.34, 3.23, 0.0]),
        acceleration_m_s2=np.array([0.00065, -0.00027, 0.0]),
        site=Site(facet_centroids(mesh)[facet], facet_normals(mesh)[facet], facet),
        landing_velocity_m_s=np.zeros(3),
        landing_acceleration_m_s2=np.zeros(3),
        tof_s=2000.0,
        clearance_m=300.0,
        clearance_metric="surface",
        cone_half_angle_rad=math.radians(30.0),
        mass_model="constant",
        surface=build_surface_index(mesh),
    )
    return f"{path.name}, {len(mesh.faces)} facets, facet {facet}", case


class BoxList:
    """Facet boxes compared by numpy: what trimesh asks of rtree, where rtree is not installed."""

    def __init__(self, triangles: np.ndarray) -> None:
        self.low, self.high = (
            np.ascontiguousarray(b.T) for b in (triangles.min(axis=1), triangles.max(axis=1))
        )

    def intersection_v(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Facets whose boxes overlap each given box, one after the other, and their numbers."""
        hits = []
        for a, b in zip(low, high, strict=True):
            overlap = self.low[0] <= b[0]
            for k in range(3):
                overlap &= (self.low[k] <= b[k]) & (self.high[k] >= a[k])
            hits.append(np.flatnonzero(overlap))
        return np.concatenate(hits), np.array([len(h) for h in hits])


class NumpySearch:
    """The two-level grid search with numpy for the prices and trimesh.proximity for the distances."""

    def __init__(self, search: GuideSearch) -> None:
        import trimesh

        mesh = search.case.asteroid.mesh
        body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        self.search, self.checked = search, 0
        self.tree = "rtree" if importlib.util.find_spec("rtree") else "numpy for rtree, which is missing"
        if self.tree != "rtree":
            body._cache["triangles_tree"] = BoxList(mesh.corners)
        self.proximity = trimesh.proximity.ProximityQuery(body)
        self.proximity.on_surface(search.case.position_m[None])  # its tree is built outside the clock

    def run(self) -> tuple[float, float]:
        """Search the coarse grid, then the fine one; return alpha and beta."""
        options = self.search.options
        shares = np.linspace(0.0, 1.0, options.coarse_points)
        at, _ = self.best(shares, shares)
        centre = (shares[k] for k in divmod(at, shares.size))
        step = shares[1]
        fine = [np.linspace(max(c - step, 0.0), min(c + step, 1.0), options.fine_points) for c in centre]
        return self.best(*fine)[1]

    def best(self, alpha_shares: np.ndarray, beta_shares: np.ndarray) -> tuple[int, tuple[float, float]]:
        """Return the index and the heights of the cheapest candidate that keeps the constraints."""
        alpha, beta, empty = heights(self.search, alpha_shares, beta_shares)
        cost, peak = self.prices(alpha, beta)
        limit = self.search.case.spacecraft.thrust_max_n / self.search.case.spacecraft.mass_kg
        for k in np.argsort(np.where(empty | (peak > limit), np.inf, cost), kind="stable"):
            self.checked += 1
            if self.keeps(self.path(self.search.curves.position, alpha[k], beta[k])) and self.keeps(
                self.path(self.search.dense, alpha[k], beta[k])
            ):
                return int(k), (float(alpha[k]), float(beta[k]))
        raise AssertionError("nothing is feasible")

    def path(self, family: np.ndarray, alpha: float, beta: float) -> np.ndarray:
        """Positions of one curve."""
        return family[:, 0] + alpha * family[:, 1] + beta * family[:, 2]

    def prices(self, alpha: np.ndarray, beta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Velocity increment and largest thrust acceleration of every candidate."""
        curves, weights = self.search.curves, np.stack([np.ones_like(alpha), alpha, beta])
        r = np.einsum("ijk,jm->imk", curves.position, weights)
        a = np.einsum("ijk,jm->imk", curves.acceleration, weights)
        u = np.linalg.norm(a + GM * r / np.linalg.norm(r, axis=-1, keepdims=True) ** 3, axis=-1)
        return np.trapezoid(u, dx=curves.step_s, axis=0), u.max(axis=0)

    def keeps(self, path: np.ndarray) -> bool:
        """Whether a path keeps 300 m up to the cone."""
        case = self.search.case
        offset = path - case.site.position_m
        share = offset @ case.site.normal - math.cos(case.cone_half_angle_rad) * np.linalg.norm(
            offset, axis=1
        )
        outside = np.flatnonzero(share < 0.0)
        if not len(outside):
            return True
        _, distance, _ = self.proximity.on_surface(path[: outside[-1] + 1])
        return bool((distance >= case.clearance_m).all())


def cpu_s(work: Callable[[], Any], rounds: int) -> tuple[float, Any]:
    """Best CPU time of some calls, s, and the last answer."""
    best, answer = math.inf, None
    for _ in range(rounds):
        start = time.process_time()
        answer = work()
        best = min(best, time.process_time() - start)
    return best, answer


def main() -> None:
    """Print the table."""
    name, case = eros()
    print(f"{name}; CPU, kernels compiled and loaded")
    options = BezierOptions()
    plan_bezier(case, options)
    whole_s, plan = cpu_s(lambda: plan_bezier(case, options), ROUNDS)
    search = prepare_search(case, options)
    search_s, found = cpu_s(lambda: search_guide_points(search), ROUNDS)
    assert isinstance(found, Found)
    baseline = NumpySearch(search)
    baseline_s, heights_m = cpu_s(baseline.run, 1)
    same = np.allclose(heights_m, (found.alpha_m, found.beta_m), rtol=1e-12)
    row("plan bezier, checked at 2001 samples", whole_s, f"{plan.status}, {plan.fuel_kg:.2f} kg")
    row("its search alone", search_s, f"{found.checked} candidates checked")
    told = "the same guide points" if same else "OTHER GUIDE POINTS"
    row(
        "the same with trimesh and numpy", baseline_s, f"{baseline.checked} checked, {told} ({baseline.tree})"
    )
    print(f"  ratio: {baseline_s / search_s:.0f} to the search, {baseline_s / whole_s:.0f} to the whole plan")
    gauss_s, gauss = cpu_s(lambda: plan_pseudospectral(case, PseudospectralOptions()), 2)
    row("plan pseudospectral", gauss_s, f"{gauss.status}, {gauss.fuel_kg:.2f} kg")
    print(f"  ratio: {gauss_s / whole_s:.0f} to the whole plan")
    if not same:
        raise SystemExit(1)


def row(name: str, cpu: float, told: str) -> None:
    """Print one line of the table."""
    print(f"  {name:38s} {1e3 * cpu:10.2f} ms  {told}")


if __name__ == "__main__":
    main()

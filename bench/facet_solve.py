"""One facet's verdict and J: our solver beside what a user would write instead, on the same facets.

``python -m bench`` prints, per case, CPU time a facet, the ratio to ours, and how verdicts and J agree;
``--list`` adds every facet. The rows:

- ours: ``landing_cli.reach.free_descent.solve_prepared``, prepared and compiled beforehand;
- ours, extremals: the paper's family, ``extremal_descent.solve_from``, on top of the row above, whose
  multipliers it starts from;
- slsqp costates: scipy's SLSQP over the paper's 7 costates, compiled RK4, finite differences by scipy;
- same, compiled differences: the differences in one compiled loop, the best a user could do;
- slsqp nodes: 20 thrust vectors instead of costates, so that the control is free as ours is;
- ipopt: CasADi + IPOPT, Hermite-Simpson, one start; with and without building the program once a facet.

Costates cannot fly along the ellipsoid: where it binds their J is that of a narrower problem.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench import slsqp_baseline
from bench.arithmetic import flops_of_iteration
from bench.peak import measured_peak
from landing_cli.body.gravity.coefficients import degree2_from_mesh
from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.reach import extremal_descent
from landing_cli.reach.free_descent import INTERVALS, PreparedCase, prepare, solve_prepared, survey
from landing_cli.reach.free_solve import BEGINNING
from landing_cli.reach.records import FacetSolutions, LandingCase, Verdict
from landing_cli.scenario.build import build
from landing_cli.scenario.load import load

IPOPT_INTERVALS = 40
REFERENCE_RADIUS_M = 246.0


@dataclass(frozen=True)
class Row:
    """One method over all facets of a case."""

    method: str
    cpu_s: float  # a facet
    reachable: np.ndarray
    j: np.ndarray


def bennu_cases(names: list[str]) -> list[LandingCase]:
    """Cases of the shipped scenario, by name."""
    loaded = load("bennu.yaml")
    built, reach = build(loaded), loaded.scenario.reach
    return [
        LandingCase(
            name=name,
            asteroid=built.asteroid,
            spacecraft=built.spacecraft,
            position_m=np.array(state.start_m),
            velocity_m_s=np.array(state.velocity_m_s),
            tof_s=tof_s,
            final_stage_s=reach.final_stage_s,
            ellipsoid_m=built.ellipsoid_m,
            glide_slope_half_angle_rad=np.radians(reach.glide_slope_half_angle_deg),
        )
        for name, state, tof_s in reach.cases()
        if name in names
    ]


def harmonics_of(case: LandingCase) -> tuple[float, ...]:
    """GM, reference radius and degree-2 coefficients of the case's mesh, for the baselines."""
    c = degree2_from_mesh(case.asteroid.mesh, REFERENCE_RADIUS_M)
    return case.asteroid.gm_m3_s2, REFERENCE_RADIUS_M, c.c20, c.c22, c.s22


def timed(method: str, facets: np.ndarray, solve: Callable[[int], tuple[bool, float]]) -> Row:
    """Solve facet by facet and take the CPU time."""
    begun = time.process_time()
    answers = [solve(int(facet)) for facet in facets]
    cpu_s = (time.process_time() - begun) / len(facets)
    return Row(method, cpu_s, np.array([a[0] for a in answers]), np.array([a[1] for a in answers]))


@dataclass(frozen=True)
class Ours:
    """Our solver on all facets in one call, the case prepared and the code compiled beforehand."""

    prepared: PreparedCase
    solutions: FacetSolutions
    row: Row

    @staticmethod
    def of(case: LandingCase, facets: np.ndarray) -> Ours:
        """Solve and time."""
        prepared = prepare(case, survey(case))
        solve_prepared(prepared, facets[:1])
        begun = time.process_time()
        solutions = solve_prepared(prepared, facets)
        return Ours(prepared, solutions, row_of("ours", solutions, time.process_time() - begun))

    def iterations(self) -> float:
        """Interior-point iterations a facet, mean."""
        return float(self.solutions.rows["iterations"].mean())


def row_of(method: str, solutions: FacetSolutions, cpu_s: float) -> Row:
    """A row of ours."""
    rows = solutions.rows
    reachable = rows["verdict"] == Verdict.REACHABLE
    j = np.where(reachable, rows["performance_index_m2_s3"], np.nan)
    return Row(method, cpu_s / len(rows), reachable, j)


def extremals(free: Ours) -> Row:
    """The paper's family from the conic solve's multipliers, whose time comes on top."""
    few = FacetSolutions(free.solutions.rows[:1], free.solutions.nodes_of(0))
    extremal_descent.solve_from(free.prepared, few)
    begun = time.process_time()
    solutions = extremal_descent.solve_from(free.prepared, free.solutions)
    return row_of("ours, extremals (on top)", solutions, time.process_time() - begun)


def slsqp(case: LandingCase, facets: np.ndarray, unknowns: str, differencing: str, label: str) -> Row:
    """Scipy's SLSQP, compiled beforehand."""
    harmonics = harmonics_of(case)

    def solve(facet: int) -> tuple[bool, float]:
        answer = slsqp_baseline.solve(case, facet, harmonics, unknowns, differencing)
        return answer.reachable, answer.j_m2_s3

    solve(int(facets[0]))
    return timed(label, facets, solve)


def ipopt(case: LandingCase, facets: np.ndarray) -> list[Row]:
    """CasADi + IPOPT from the straight start; one row without and one with the building of the program."""
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "truth"))
    from collocation import program, solve, start_through
    from problem import Problem

    gm, radius, c20, c22, s22 = harmonics_of(case)
    craft = case.spacecraft
    problem = Problem(
        r0=tuple(case.position_m),
        v0=tuple(case.velocity_m_s),
        omega=case.asteroid.rotation_rate_rad_s,
        gravity=("harmonics", gm, radius, c20, c22, s22),
        mass=craft.mass_kg,
        thrust=craft.thrust_max_n,
        isp=craft.isp_s,
        tof=case.tof_s,
        t_final=case.final_stage_s,
        semi_axes=tuple(case.ellipsoid_m),
        theta=case.glide_slope_half_angle_rad,
    )
    centroids, normals = facet_centroids(case.asteroid.mesh), facet_normals(case.asteroid.mesh)

    def one(facet: int) -> tuple[bool, float]:
        here = problem.at(centroids[facet], normals[facet])
        path = solve(here, IPOPT_INTERVALS, "j", *start_through(here, IPOPT_INTERVALS, None), 1.0)
        return path.solved, path.j if path.solved else np.nan

    program.cache_clear()
    begun = time.process_time()
    program("harmonics", IPOPT_INTERVALS)
    building = time.process_time() - begun
    row = timed("ipopt, program built once", facets, one)
    return [row, Row("ipopt, built for each facet", row.cpu_s + building, row.reachable, row.j)]


def compare(case: LandingCase, facets: np.ndarray) -> list[Row]:
    """Every method on the same facets."""
    free = Ours.of(case, facets)
    return [
        free.row,
        extremals(free),
        slsqp(case, facets, "costates", "scipy", "slsqp costates"),
        slsqp(case, facets, "costates", "compiled", "slsqp costates, compiled differences"),
        slsqp(case, facets, "nodes", "scipy", "slsqp nodes"),
        slsqp(case, facets, "nodes", "compiled", "slsqp nodes, compiled differences"),
        *ipopt(case, facets),
    ]


def print_case(case: LandingCase, facets: np.ndarray, rows: list[Row], listed: bool) -> None:
    """The table of one case: against ours, J as (other / ours - 1)."""
    first = rows[0]
    print(f"\n{case.name}: {len(facets)} of {len(case.asteroid.mesh.faces)} facets")
    print(f"{'method':38s}{'ms CPU':>10s}{'ratio':>8s}{'reach':>7s}{'only it':>9s}{'only we':>9s}", end="")
    print(f"{'J p50':>10s}{'J worst':>10s}{'J best':>10s}")
    for row in rows:
        both = row.reachable & first.reachable
        excess = (row.j / first.j - 1)[both] if both.any() else np.array([np.nan])
        only_it, only_we = (row.reachable & ~first.reachable).sum(), (first.reachable & ~row.reachable).sum()
        print(f"{row.method:38s}{1e3 * row.cpu_s:10.3f}{row.cpu_s / first.cpu_s:8.0f}", end="")
        print(f"{row.reachable.sum():7d}{only_it:9d}{only_we:9d}", end="")
        print(f"{np.median(excess):10.1e}{excess.max():10.1e}{excess.min():10.1e}")
    if listed:
        print("\nJ by facet, m2/s3 (- not reachable):")
        print(f"{'facet':>6s}" + "".join(f"{i:>14d}" for i in range(len(rows))))
        for k, facet in enumerate(facets):
            cells = (f"{row.j[k]:14.6e}" if row.reachable[k] else f"{'-':>14s}" for row in rows)
            print(f"{facet:6d}" + "".join(cells))
        print("columns: " + "; ".join(f"{i} {row.method}" for i, row in enumerate(rows)))


def main() -> None:
    """Run the benchmark and print its tables."""
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__.splitlines()[0])
    parser.add_argument("--cases", nargs="+", default=["north_pole_700s", "north_pole_900s"])
    parser.add_argument("--facets", type=int, default=40, help="facets a case, evenly spaced")
    parser.add_argument("--list", action="store_true", help="print every facet's J by every method")
    options = parser.parse_args()
    scalar, vector = measured_peak()
    print(f"measured peak of one core, float64: scalar {scalar / 1e9:.1f}, vector {vector / 1e9:.1f} Gflop/s")
    for case in bennu_cases(options.cases):
        total = len(case.asteroid.mesh.faces)
        facets = np.unique(np.linspace(0, total - 1, options.facets).astype(np.int64))
        rows = compare(case, facets)
        print_case(case, facets, rows, options.list)
        every = Ours.of(case, np.arange(total))
        cpu_s, share = every.row.cpu_s, every.row.reachable.sum() / total
        print(f"ours over all {total} facets: {1e3 * cpu_s:.3f} ms CPU a facet, {share:.1%} reachable")
        told = ", ".join(f"{row.method} {row.cpu_s / cpu_s:.0f}" for row in rows if "slsqp" in row.method)
        print(f"times that: {told}")
        # every facet begins with BEGINNING iterations on half as many intervals
        flops = (every.iterations() - BEGINNING) * flops_of_iteration(INTERVALS)
        flops = (flops + BEGINNING * flops_of_iteration(INTERVALS // 2)) / cpu_s
        print(
            f"{every.iterations():.1f} iterations a facet: at least {flops / 1e9:.1f} Gflop/s (planes and"
            f" certificate not counted), {flops / scalar:.0%} of the scalar and {flops / vector:.0%} of the"
            " vector peak"
        )
        both = extremals(every)
        print(f"extremals over all facets, on top: {1e3 * both.cpu_s:.3f} ms CPU a facet")
        begun = time.process_time()
        prepare(case, survey(case))
        print(f"survey and preparation, once a case: {1e3 * (time.process_time() - begun):.0f} ms CPU")


if __name__ == "__main__":
    main()

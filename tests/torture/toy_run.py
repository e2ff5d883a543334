"""A run like ``reach run`` with a made-up solver: the same dispatch, journal, store, signals and exit codes.

``toy_run.py -o PATH [--resume] [--force] [--jobs N] [--backend B] [--name NAME]``
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from landing_cli.cli import guard

CHUNK_FACETS = 16
CASES = ("pole_700s", "pole_900s")
FACETS = 320


def solve(seed: int, facets):  # type: ignore[no-untyped-def]
    """Make up an answer from the facet's number alone."""
    import numpy as np
    from programs import die_on, note_chunk

    from landing_cli.reach.records import FacetSolutions, Verdict, blank_rows

    note_chunk(f"{CASES[seed]}/{facets[0]}")
    die_on(facets + seed * FACETS)
    rows, nodes = blank_rows(facets), []
    for row, facet in zip(rows, facets.tolist(), strict=True):
        rng = np.random.default_rng((seed, facet))
        row["verdict"] = rng.choice(list(Verdict)[1:])
        row["performance_index_m2_s3"] = rng.normal()
        row["thrust_nodes"] = rng.integers(0, 41)
        nodes.append(rng.normal(size=(row["thrust_nodes"], 3)))
        time.sleep(0.002)
    return FacetSolutions(rows, np.concatenate(nodes))


def run(arguments: Sequence[str]) -> int:
    """Run, resume or refuse, as a mission's pipeline does."""
    choices = _choices(arguments)
    from landing_cli.parallel import WorkPlan, pin_blas_threads

    pin_blas_threads()
    import numpy as np

    from landing_cli.errors import PartialResult
    from landing_cli.reach.recorded import solve_recorded
    from landing_cli.reach.stored import CaseResult, ReachRun, run_to_tree
    from landing_cli.reach.summary import summarise
    from landing_cli.results.identity import RunIdentity
    from landing_cli.results.output import finish_output, open_output
    from landing_cli.results.provenance import Stopwatch

    watch = Stopwatch()
    identity = RunIdentity(
        "toy run", f"name: {choices.name}\nfacets: {FACETS}\n", "0" * 64, "1", chunk_facets=CHUNK_FACETS
    )
    guard.hint_on_interrupt("continue with --resume")
    journal = open_output(choices.output, identity, resume=choices.resume, force=choices.force)
    if journal is None:
        guard.tell(f"{choices.output} is up to date")
        return 0
    plan = WorkPlan(choices.jobs, choices.backend, choices.scheduler)
    chunks = [np.arange(i, i + CHUNK_FACETS) for i in range(0, FACETS, CHUNK_FACETS)]
    with journal:
        cases = []
        for seed, (name, case) in enumerate(zip(CASES, _cases(), strict=True)):
            work = partial(solve, seed)
            solutions, lost = solve_recorded(journal, name, chunks, work, plan)
            summary = summarise(case.asteroid.mesh, solutions)
            cases.append(CaseResult(case, "pole", solutions, summary, lost=lost))
        result = ReachRun(tuple(cases))
        finish_output(journal, run_to_tree(result), {}, watch.provenance(), complete=not result.lost_facets)
    print(f"wrote {choices.output}")
    if result.lost_facets:
        raise PartialResult(f"{result.lost_facets} facets were lost", fix="--resume tries them again")
    return 0


def _choices(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--force", action="store_true")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--backend", default="threads")
    parser.add_argument("--scheduler")
    parser.add_argument("--name", default="toy")
    return parser.parse_args(arguments)


def _cases():  # type: ignore[no-untyped-def]
    import numpy as np

    from landing_cli.body.asteroid import Asteroid
    from landing_cli.body.gravity.field import GravityField, GravityKind
    from landing_cli.body.mesh import Mesh
    from landing_cli.flight.spacecraft import Spacecraft
    from landing_cli.reach.records import LandingCase

    mesh = Mesh(np.eye(3), np.tile([[0, 1, 2]], (FACETS, 1)))
    body = Asteroid("toy", mesh, 4e-4, GravityField(GravityKind.POINT_MASS, np.array([5.0])), 5.0)
    craft, at, still, axes = Spacecraft(2000.0, 20.0, 400.0), np.array([0, 0, 800.0]), np.zeros(3), np.ones(3)
    return [LandingCase(name, body, craft, at, still, 700.0, 200.0, axes, 1.0) for name in CASES]


if __name__ == "__main__":
    import toy_run  # the workers must find the solver in a module of that name

    guard.run_process(toy_run.run)

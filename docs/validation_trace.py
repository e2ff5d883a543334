"""The boundary followed by the margin: what it asks and misses on every shipped case, and how it grows."""

# ruff: noqa: E501 (lines of the page)

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from validation_domain import Runs
from validation_text import percent, table

from landing_cli.reach.figures.traced import trace_figure
from landing_cli.reach.free_descent import prepare, survey
from landing_cli.reach.margin import thrust_levels
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import CaseResult
from landing_cli.reach.trace import Answers
from landing_cli.reach.traced import (
    FoundTrace,
    find_trace,
    trace_comparison,
    trace_group,
    trace_misses,
    trace_summary,
)
from landing_cli.results.plotting import BLUE, GREY, RED, add_title, new_figure, style, write_png
from landing_cli.results.surface_map import map_surface

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from bench.scaling_bench import exponent, measure  # noqa: E402

DRAWN = "mid_latitude_700s"
TRAVERSED, TRACED_ONLY = [2692, 10768], [49152, 196608]


def traced(result: CaseResult, shared: Any) -> FoundTrace:
    """Trace a case that was traversed: its verdicts answer, levels are solved where they are asked for."""
    prepared, rows = prepare(result.case, shared), result.solutions.rows

    def ask(facets: NDArray[np.int64]) -> Answers:
        verdict = rows["verdict"][facets]
        level = thrust_levels(prepared, facets).level
        return Answers(verdict == Verdict.REACHABLE, verdict != Verdict.UNRESOLVED, level)

    return find_trace(result.case, shared, ask)


def traces(runs: Runs, images: Path) -> str:
    """The section on the trace, with its two figures."""
    rows, totals = [], np.zeros(4)
    for name, run in runs.items():
        shared = survey(run.cases[0].case)
        for result in run.cases:
            found = traced(result, shared)
            told = trace_summary(result.case, found) | trace_comparison(result.case, found, result.solutions)
            sides = len(np.unique([found.loops.inside, found.loops.outside]))
            rows.append(
                (
                    f"{name} {result.case.name}",
                    len(result.solutions.rows),
                    sides,
                    told["N"],
                    percent(told["N"], len(result.solutions.rows)),
                    f"{told['reachable_components']} + {told['unreachable_components']}",
                    told["smaller_components"],
                    told["loops"],
                    told["misclassified"],
                    f"{told['missed_components']} + {told['missed_smaller']}",
                    f"{told['misclassified_m2']:.0f}",
                )
            )
            totals += told["misclassified"], told["missed_components"], told["missed_smaller"], told["N"]
            if name == "bennu" and result.case.name == DRAWN:
                _draw_trace(result, found, images / "validation-trace.png")
    scaled = measure(TRAVERSED, 700.0, flat=False) + measure(TRACED_ONLY, 700.0, flat=False, traverse=False)
    _draw_scaling(scaled, images / "validation-scaling.png")
    sizes = [row["facets"] for row in scaled]
    solves = [row["trace"]["N"] for row in scaled]
    wrong = ", ".join(f"{row['misses'][0]} of {row['facets']}" for row in scaled if "misses" in row)
    columns = (
        "case",
        "facets",
        "facets at the boundary",
        "N",
        "N/N_f",
        "components of 3 facets and more, reachable + not",
        "smaller",
        "loops",
        "wrong facets",
        "components missed, of 3 and more + smaller",
        "wrong, m²",
    )
    return f"""## 11. The boundary followed

`method: trace` asks an even covering of the surface, estimates the least thrust level of every other facet from the
levels found, place and normal taken together, and asks where the estimate may be wrong about the side of 1; it ends
when both facets of every edge of the boundary are solved. The rest takes the verdict of the facets around it. What it
can miss is an island that no asked facet touches and whose levels no neighbour foretells. Against the traversal of
every shipped case, verdicts from there:

{table(columns, rows)}

All cases together: {totals[0]:.0f} wrong facets, {totals[1]:.0f} components of three facets and more missed, {totals[2]:.0f} smaller ones.

![The trace over Bennu](images/validation-trace.png)

On one smooth body, Bennu refined by Loop subdivision (north pole, 700 s), the solves grow with the power
{exponent(sizes, solves):.3f} of the facets ({", ".join(f"{n} of {m}" for n, m in zip(solves, sizes, strict=True))}). Wrong facets
where every facet was solved too: {wrong}. `python -m bench scaling` traverses the large meshes as well, and prints the
CPU and the memory of both.

![How solves grow](images/validation-scaling.png)
"""


def _draw_trace(result: CaseResult, found: FoundTrace, path: Path) -> None:
    summary = trace_summary(result.case, found) | trace_comparison(result.case, found, result.solutions)
    group = trace_group(found, trace_misses(found, result.solutions))
    drawn = CaseResult(result.case, result.initial_state, result.solutions, {"trace": summary}, group)
    with style():
        write_png(trace_figure(drawn, group, map_surface(result.case.asteroid.mesh)), path)


def _draw_scaling(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw facets solved, and CPU time, over the facets of the mesh."""
    sizes = np.array([row["facets"] for row in rows], dtype=float)
    solves = np.array([row["trace"]["N"] for row in rows])
    with style():
        figure = new_figure(9.0, 3.9)
        left, right = figure.add_axes((0.08, 0.14, 0.38, 0.66)), figure.add_axes((0.58, 0.14, 0.38, 0.66))
        left.loglog(sizes, solves, "o-", color=BLUE, label="trace")
        left.loglog(sizes, sizes, color=GREY, label="traversal: every facet")
        root = solves[0] * np.sqrt(sizes / sizes[0])
        left.loglog(sizes, root, "--", color=RED, lw=1.0, label="the root of the facets")
        left.set(xlabel="facets", ylabel="facets solved")
        right.loglog(sizes, [row["trace"]["cpu_s"] for row in rows], "o-", color=BLUE, label="trace")
        known = [row for row in rows if "traverse" in row]
        right.loglog(
            [row["facets"] for row in known],
            [row["traverse"]["cpu_s"] for row in known],
            "s-",
            color=GREY,
            label="traversal",
        )
        right.set(xlabel="facets", ylabel="CPU of a run (s)")
        for axes in (left, right):
            axes.grid(True)
            axes.legend(loc="upper left")
        add_title(figure, "How a run grows with the mesh", "Bennu, Loop subdivision, north pole, 700 s")
        write_png(figure, path)

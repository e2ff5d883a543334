"""How surely Bennu's facets are reachable, and what holds the probabilities to closed forms."""

# ruff: noqa: E501 (lines of the page)

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm
from validation_text import exact, percent, table

from landing_cli.parallel.plan import WorkPlan
from landing_cli.reach.free_descent import prepare, solve_prepared, survey
from landing_cli.reach.margin import thrust_levels
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import ReachRun
from landing_cli.results.plotting import style, write_png
from landing_cli.results.store import read
from landing_cli.results.surface_map import map_surface
from landing_cli.scenario.load import load
from landing_cli.studies.disperse.draws import deviations, standard_normals
from landing_cli.studies.disperse.figures.probability_map import probability_figure
from landing_cli.studies.disperse.figures.samples import convergence_figure, telling_facets
from landing_cli.studies.disperse.pair_work import PairWork, verdicts_of
from landing_cli.studies.disperse.pipeline import RunOptions, run
from landing_cli.studies.disperse.records import CaseDispersion, Drawing, Spread, drivers_of
from landing_cli.studies.disperse.statistics import clopper_pearson, facet_rows, rank_correlations
from landing_cli.studies.disperse.verify import DispersionReport, verify_run

ROOT = Path(__file__).resolve().parent.parent
CASE, SAMPLES = "north_pole_700s", 200
# The check against the margin: thrust alone, its sigma, how many samples, and the facets' distance from tau = 1.
THRUST_SIGMA, THRUST_SAMPLES, NEAR = 0.02, 60, 0.03
COMPARED_SAMPLES = 3


def dispersed_starts(bennu: ReachRun, images: Path, say: Callable[[str], None]) -> str:
    """Probability map, drivers, and the checks of draws, verdicts, probabilities and intervals."""
    output = ROOT / "runs" / "bennu-reach-disperse.h5"
    overrides = [f"disperse.cases=[{CASE}]", f"disperse.samples={SAMPLES}"]
    loaded = load(str(ROOT / "configs" / "bennu.yaml"), overrides)
    options = RunOptions(WorkPlan(jobs=len(os.sched_getaffinity(0))), resume=True)
    (result,) = run(loaded, output, options, lambda done, total: None, say).run.cases
    with style():
        write_png(
            probability_figure(result, map_surface(bennu.asteroid.mesh)),
            images / "validation-probability.png",
        )
        write_png(convergence_figure(result, telling_facets(result)), images / "validation-convergence.png")
    say("dispersions against the margin, and the full solve")
    return f"""## 14. How surely, from a start that is not known exactly

`reach disperse bennu.yaml --case {CASE} --samples {SAMPLES} --seed {result.drawing.seed}`, with the dispersions that the shipped scenario
states. The control is optimised again for each sample: this is the probability that a site is reachable by a guidance
that knows where it is, not that of one plan hitting it.

{_numbers(result, dict(read(output).provenance))}

![Probability map](images/validation-probability.png)

![Intervals that narrow with the samples](images/validation-convergence.png)

{_drivers(result)}

{_checks(result, bennu)}
"""


def _numbers(result: CaseDispersion, provenance: dict[str, Any]) -> str:
    s, area = result.summary, result.summary["reachable_area_m2"]
    rows = [
        (
            "facets reachable in every sample / in some / in none",
            f"{s['always']} / {s['sometimes']} / {s['never']}",
        ),
        ("unresolved pairs of sample and facet", f"{s['unresolved']} of {result.verdicts.size}"),
        (
            "reachable area, mean (5 % to 95 %), km²",
            f"{area['mean'] / 1e6:.4f} ({area['p05'] / 1e6:.4f} to {area['p95'] / 1e6:.4f})",
        ),
        (f"widest {100 * s['confidence']:g} % interval of a probability", f"{s['widest_interval']:.3f}"),
    ]
    if not provenance.get("resumed"):
        cpu_s = float(provenance["cpu_s"])
        rows.append(
            (
                "CPU of the run, s",
                f"{cpu_s:.0f}, or {1e3 * cpu_s / result.verdicts.size:.3f} ms a pair, start-up included",
            )
        )
    return table(("", CASE), rows)


def _drivers(result: CaseDispersion) -> str:
    drawing = result.drawing
    drawn = deviations(drawing.spread, standard_normals(drawing.seed, drawing.samples))
    values = rank_correlations(result.samples["reachable_area_m2"], drawn)
    counts = np.bincount(result.facets["driver"], minlength=16)
    rows = [
        (driver.name.lower().replace("_", " "), f"{sigma:.3g}", f"{value:+.2f}", int(counts[driver]))
        for driver, sigma, value in zip(
            drivers_of(drawing.spread.axes), drawing.spread.sigmas, values, strict=True
        )
    ]
    return f"""What the domain follows: Spearman's rank correlation of its area with each drawn quantity, and how many facets'
verdicts follow that quantity most.

{table(("quantity", "1 sigma, SI", "correlation with the area", "facets that it drives"), rows)}"""


def _checks(result: CaseDispersion, bennu: ReachRun) -> str:
    case = result.case
    nominal = prepare(case, survey(case))
    (report,) = verify_run((result,), jobs=len(os.sched_getaffinity(0)))
    rows = [
        *_against_reach_run(nominal, bennu),
        *_against_full_solve(result, nominal),
        *_against_margin(nominal),
        *_coverage(),
        *_second_look(report),
    ]
    return f"""Each line is computed here. The margin tau of a facet is found by another objective than its verdict is; with the
thrust alone dispersed by a share sigma, the verdict of a sample is whether its thrust exceeds tau, and the probability is
Phi((1 - tau) / sigma).

{table(("check", "found"), rows)}"""


def _against_reach_run(nominal: Any, bennu: ReachRun) -> list[tuple[str, str]]:
    stored = next(c for c in bennu.cases if c.case.name == CASE).solutions.rows["verdict"]
    none = Spread("body", np.zeros((6, 6)), 0.0, 0.0, 0.0)
    work = PairWork((nominal,), (np.eye(3),), deviations(none, standard_normals(1, 1)))
    apart = int((work(range(work.facets)).verdicts != stored).sum())
    return [("verdicts without dispersion that are not those of `reach run`", f"{apart} of {len(stored)}")]


def _against_full_solve(result: CaseDispersion, nominal: Any) -> list[tuple[str, str]]:
    drawing = result.drawing
    work = PairWork(
        (nominal,), (np.eye(3),), deviations(drawing.spread, standard_normals(drawing.seed, drawing.samples))
    )
    facets, apart = np.arange(work.facets), 0
    for sample in range(COMPARED_SAMPLES):
        full = solve_prepared(work.prepared(0, sample), facets).rows["verdict"]
        apart += int((result.verdicts[sample] != full).sum())
    return [
        (
            "stored verdicts that are not those of the full solve, in the first samples",
            f"{apart} of {COMPARED_SAMPLES * len(facets)}",
        )
    ]


def _against_margin(nominal: Any) -> list[tuple[str, str]]:
    level = thrust_levels(nominal, np.arange(len(nominal.shared.centroids_m))).level
    facets = np.flatnonzero(np.abs(level - 1.0) < NEAR)
    thrust_n = nominal.case.spacecraft.thrust_max_n
    spread = Spread("body", np.zeros((6, 6)), 0.0, THRUST_SIGMA * thrust_n, 0.0)
    drawn = deviations(spread, standard_normals(2, THRUST_SAMPLES))
    work = PairWork((nominal,), (np.eye(3),), drawn)
    verdicts = np.stack([verdicts_of(work.prepared(0, k), facets) for k in range(THRUST_SAMPLES)])
    above = 1.0 + drawn[:, 7:8] / thrust_n - level[facets]
    wrong = (verdicts == Verdict.REACHABLE) != (above > 0.0)
    apart = float(np.abs(above[wrong]).max(initial=0.0))
    rows = facet_rows(verdicts, Drawing(2, THRUST_SAMPLES, 0.95, spread), drawn)
    true = norm.cdf((1.0 - level[facets]) / THRUST_SIGMA)
    held = int(((rows["probability_low"] <= true) & (true <= rows["probability_high"])).sum())
    return [
        (
            f"thrust alone, {len(facets)} facets within {NEAR:g} of tau = 1, {THRUST_SAMPLES} samples: verdicts against the margin",
            f"{int(wrong.sum())} of {wrong.size}, all within {exact(apart)} of tau",
        ),
        (
            "95 % intervals that hold Phi((1 - tau) / sigma)",
            f"{held} of {len(facets)} ({percent(held, len(facets))})",
        ),
    ]


def _coverage() -> list[tuple[str, str]]:
    rng, repeats, trials, none = np.random.default_rng(1), 20_000, 1000, np.zeros(1, dtype=np.int64)
    shares = []
    for p in (0.001, 0.01, 0.1, 0.5, 0.9, 0.999):
        low, high = clopper_pearson(rng.binomial(trials, p, repeats), none, trials, 0.95)
        shares.append(float(((low <= p) & (p <= high)).mean()))
    told = f"{100 * min(shares):.1f} to {100 * max(shares):.1f} %"
    return [
        (
            f"95 % intervals that hold p, {repeats} simulated runs of {trials} samples, p from 0.001 to 0.999",
            told,
        )
    ]


def _second_look(report: DispersionReport) -> list[tuple[str, str]]:
    miss = report.worst["touchdown_miss_m"].value if report.flights else np.nan
    state = "verified" if report.verified else f"FAILED: {report.reason}"
    told = f"{state}: {report.pairs} pairs solved again, {report.flights} flights flown again, worst miss {exact(miss)} m"
    return [("`landing results verify`", told)]

"""Tours of asteroids beside what Liu et al. (2023) print, and what a search of the whole catalogue finds."""

# ruff: noqa: E501 (lines of the page)

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from validation_text import table

from landing_cli.errors import InputRefused
from landing_cli.parallel.plan import WorkPlan
from landing_cli.scenario.load import LoadedTour, load_tour
from landing_cli.sources.catalogue_search import find_catalogue
from landing_cli.tour.cases import tour_case
from landing_cli.tour.comparison import compare_with_paper, escape_beside_paper
from landing_cli.tour.escape_records import EscapeRun
from landing_cli.tour.escape_run import escape_request, run_escape
from landing_cli.tour.pipeline import Request, RunOptions, run_compare, run_search
from landing_cli.tour.run_records import TourRun
from landing_cli.tour.summary import front, summarise
from landing_cli.tour.verify import verify_run

ROOT = Path(__file__).resolve().parent.parent
CATALOGUE = "NEA_2019.txt.gz"
PAPERS_BEST_M_S = 542.1  # scheme 10: five asteroids

ABSENT = f"""### The whole catalogue

Not computed: the list of near-Earth asteroids of 2019 (`{CATALOGUE}`) is not shipped (`LANDING_REFERENCE_DATA`).
"""


def flyby_tours(say: Callable[[str], None]) -> str:
    """Section 9: escape, the printed schemes, and the search."""
    options = RunOptions(WorkPlan(jobs=len(os.sched_getaffinity(0))), resume=True)
    escape = run_escape(escape_request(None), ROOT / "runs" / "liu2023-tour-escape.h5", options).run
    say("the schemes of Liu et al. (2023)")
    loaded = load_tour(str(ROOT / "configs" / "published" / "liu2023-ce5.yaml"))
    compared = _run("compare", loaded, options)
    assert isinstance(escape, EscapeRun)
    return f"""## 10. Asteroids on the way

`configs/published/liu2023-ce5.yaml`, beside Liu, Chen and Zhang (2023), "the paper" of this section.

{_escape(escape)}

{_compared(compared)}

{_searched(options, say)}"""


def _run(command: str, loaded: LoadedTour, options: RunOptions, name: str = "") -> TourRun:
    request = Request(f"tour {command}", loaded, tour_case(loaded))
    output = ROOT / "runs" / f"{name or loaded.scenario.name}-tour-{command}.h5"
    run = run_compare if command == "compare" else run_search
    found = run(request, output, options, lambda done, total: None).run
    assert isinstance(found, TourRun)
    return found


def _escape(run: EscapeRun) -> str:
    told = escape_beside_paper(run)
    corners = table(
        ["escape from", "least, m/s", "paper", "greatest, m/s", "paper"],
        [
            [
                f"the {r['body'].title()}",
                f"{r['least_m_s']:.1f}",
                f"{r['printed_least_m_s']:g}",
                f"{r['greatest_m_s']:.1f}",
                f"{r['printed_greatest_m_s']:g}",
            ]
            for r in told["corners"]
        ],
    )
    flights = table(
        [
            "perigee, km",
            "apogee, km",
            "to infinity, m/s",
            "to 1.5e6 km, m/s",
            "N-body to 1.5e6 km, m/s",
            "paper",
        ],
        [
            [
                f"{r['perigee_km']:.0f}",
                f"{r['apogee_km']:.4g}",
                f"{r['two_body_m_s']:.1f}",
                f"{r['two_body_reach_m_s']:.1f}",
                f"{r['flown_least_m_s']:.1f} / {r['flown_m_s']:.1f} / {r['flown_most_m_s']:.1f}",
                f"{r['printed_m_s']:g}",
            ]
            for r in told["flights"]
        ],
    )
    return f"""### Escape

Eqs 1-2, with the root where it belongs, over the altitudes of Fig. 1:

{corners}

The two orbits that the paper flies under perturbations. Two-body increments at the perigee; in N-body least, median and
most over a month of epochs and all directions of the orbit:

{flights}

{_listed(told["notes"])}"""


def _compared(run: TourRun) -> str:
    told = compare_with_paper(run)
    rows = [
        [
            r["scheme"],
            r["designation"],
            r["printed_date"],
            f"{r['printed_delta_v_m_s']:.1f}",
            f"{r['as_printed_m_s']:.1f}",
            f"{r['least_m_s']:.1f}",
            f"{r['nbody_delta_v_m_s']:.1f}",
            f"{r['printed_distance_km']:.4g}",
            "yes" if r["on_day"] else "no",
            f"{r['printed_diameter_m']:g}",
            f"{r['diameter_m']:.1f}",
        ]
        for r in told["flybys"]
    ]
    columns = [
        "scheme",
        "asteroid",
        "day",
        "paper, m/s",
        "as printed",
        "least",
        "N-body",
        "paper, km",
        "on that day",
        "paper, m",
        "size, m",
    ]
    schemes = "\n".join(f"- Scheme {s['number']}: {s['told']}." for s in told["schemes"])
    return f"""### The printed schemes

{table(columns, rows)}

{schemes}

{_listed(told["notes"])}

{_verified(run)}"""


def _searched(options: RunOptions, say: Callable[[str], None]) -> str:
    try:
        find_catalogue(CATALOGUE)
    except InputRefused:
        return ABSENT
    say("the whole catalogue")
    loaded = load_tour(str(ROOT / "configs" / "ce5.yaml"), [f"tour.catalogue={CATALOGUE}"])
    run = _run("search", loaded, options, "ce5-nea-2019")
    best = [summarise(entry) for entry in front(run.cases)]
    fronts = table(
        ["asteroids", "N-body, m/s", "two-body, m/s", "duration, d", "sequence"],
        [
            [
                c["asteroids"],
                f"{c['nbody_delta_v_m_s']:.1f}",
                f"{c['delta_v_m_s']:.1f}",
                f"{c['duration_d']:.0f}",
                ", ".join(c["targets"]),
            ]
            for c in best
        ],
    )
    depths = table(
        ["asteroids", "transfers tried", "within the limits", "kept", "least two-body sum, m/s"],
        [[d.asteroids, d.tried, d.within_limits, d.kept, f"{d.least_delta_v_m_s:.1f}"] for d in run.depths],
    )
    return f"""### The whole catalogue

`configs/ce5.yaml` with the {run.facts.catalogue_rows} near-Earth asteroids of 2019, {run.facts.searched_targets} of them targets:
{run.facts.limits.delta_v_m_s:g} m/s, to the end of 2022, perihelia below 1.2 au. {_better(best)} {len(run.cases)} chains hold in N-body,
{len(run.broken)} broke. The front: no chain has more asteroids for less and sooner.

{fronts}

How far the search looked:

{depths}

{_verified(run)}"""


def _listed(notes: list[str]) -> str:
    return "\n".join(f"- {note}" for note in notes)


def _better(chains: list[dict[str, Any]]) -> str:
    most = max((c["asteroids"] for c in chains), default=0)
    told = [f"The paper's best is 5 asteroids for {PAPERS_BEST_M_S:g} m/s."]
    for count in range(5, most + 1):
        least = min((c["nbody_delta_v_m_s"] for c in chains if c["asteroids"] == count), default=None)
        if least is not None:
            told.append(f"Here {count} take {least:.1f} m/s.")
    return " ".join(told)


def _verified(run: TourRun) -> str:
    reports = verify_run(run.cases)
    flown = [report for report in reports if report.flown]
    miss = max((report.worst["miss_m"].value for report in flown), default=float("nan"))
    return f"""Flown again by DOP853 in ICRF axes, from the ephemeris kernel's own series: {sum(r.verified for r in flown)} of {len(flown)} chains verified,
and passed their asteroids within {miss:.1f} m."""

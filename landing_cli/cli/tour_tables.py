"""What the tour commands print."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from landing_cli.cli import console

if TYPE_CHECKING:
    from landing_cli.tour.cases import TourCase
    from landing_cli.tour.escape_records import EscapeRun
    from landing_cli.tour.run_records import TourRun

_SHOWN = 20
_CHAIN_COLUMNS = ("name", "asteroids", "nbody_delta_v_m_s", "delta_v_m_s", "duration_d", "front", "targets")
_FLYBY_COLUMNS = (
    "designation",
    "date_utc",
    "nbody_delta_v_m_s",
    "delta_v_m_s",
    "speed_m_s",
    "phase_angle_deg",
    "geocentric_distance_km",
    "diameter_m",
    "apparent_magnitude",
)


def case_facts(case: TourCase) -> dict[str, Any]:
    """Tell what a tour's scenario comes to, for `--dry-run` and `landing scenario check`.

    Parameters
    ----------
    case : TourCase
        The case.

    Returns
    -------
    dict
    """
    from landing_cli.tour.time_scales import t_s_to_utc

    return {
        "scenario": case.name,
        "catalogue": case.catalogue.source,
        "rows": len(case.catalogue) + len(case.catalogue.bad_rows),
        "bad_rows": len(case.catalogue.bad_rows),
        "targets": len(case.targets),
        "departure_utc": t_s_to_utc(case.departure.t_s),
        "end_utc": t_s_to_utc(case.limits.end_t_s),
        "delta_v_max_m_s": case.limits.delta_v_m_s,
        "ephemeris": case.kernel,
        "catalogue_sha256": case.catalogue.sha256,
    }


def print_facts(facts: dict[str, Any], as_json: bool) -> None:
    """Print facts: a table, or JSON.

    Parameters
    ----------
    facts : dict
        From :func:`case_facts`, or alike.
    as_json : bool
        Print JSON.
    """
    if as_json:
        console.print_json(facts)
    else:
        console.print_table(["quantity", "value"], [[key, value] for key, value in facts.items()])


def print_search(run: TourRun, path: Path, as_json: bool) -> None:
    """Print the chains that a search found, and the flybys of the best.

    Parameters
    ----------
    run : TourRun
        As it was flown, or read from its file.
    path : Path
        Its file.
    as_json : bool
        Print JSON.
    """
    from landing_cli.tour.summary import summarise_run

    told = summarise_run(run)
    if as_json:
        console.print_json({"run": str(path), "scenario": run.facts.name, **told})
        return
    chains = told["chains"]
    rows = [
        [
            *(chain[key] for key in _CHAIN_COLUMNS[:5]),
            "front" if chain["name"] in told["front"] else "",
            ", ".join(chain["targets"]),
        ]
        for chain in chains[:_SHOWN]
    ]
    if rows:
        console.print_table(_CHAIN_COLUMNS, rows, title=f"Chains flown in N-body: {run.facts.name}")
        more = f"; {len(chains) - _SHOWN} more in the file" if len(chains) > _SHOWN else ""
        console.print_text(f"\nFlybys of {chains[0]['name']}{more}")
        flybys = [[row[key] for key in _FLYBY_COLUMNS] for row in chains[0]["flybys"]]
        console.print_table(_FLYBY_COLUMNS, flybys)


def print_comparison(run: TourRun, path: Path, as_json: bool) -> None:
    """Print the paper's schemes beside the same flown again.

    Parameters
    ----------
    run : TourRun
        As it was flown, or read from its file.
    path : Path
        Its file.
    as_json : bool
        Print JSON.
    """
    from landing_cli.tour.comparison import TABLE_COLUMNS, compare_with_paper

    told = compare_with_paper(run)
    if as_json:
        console.print_json({"run": str(path), "scenario": run.facts.name, **told})
        return
    rows = [[row[key] for key in TABLE_COLUMNS] for row in told["flybys"]]
    console.print_table(TABLE_COLUMNS, rows, title="Liu et al. (2023), Table 2, and the same flown again")
    for scheme in told["schemes"]:
        console.print_text(f"\nscheme {scheme['number']}: {scheme['told']}")
    console.print_text("\n" + "\n".join(told["notes"]))


def print_escape(run: EscapeRun, path: Path, as_json: bool) -> None:
    """Print what it takes to leave, beside the paper's figures.

    Parameters
    ----------
    run : EscapeRun
        As it was flown, or read from its file.
    path : Path
        Its file.
    as_json : bool
        Print JSON.
    """
    from landing_cli.tour.comparison import escape_beside_paper, escape_table

    told = escape_beside_paper(run)
    if as_json:
        console.print_json({"run": str(path), **told})
        return
    for entry in run.cases:
        columns, rows = escape_table(entry)
        console.print_text(f"{entry.name}: velocity increment, m/s; apoapsis altitude in km to the right")
        console.print_table(columns, rows)
        console.print_text("")
    corners, flights = told["corners"], told["flights"]
    if corners:
        console.print_table(list(corners[0]), [list(row.values()) for row in corners])
    if flights:
        console.print_text("")
        columns = [key for key in flights[0] if key != "told"]
        console.print_table(columns, [[row[key] for key in columns] for row in flights])
        console.print_text("\n" + "\n".join(told["notes"]))

"""The numbers that chains of flybys are summed up in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from landing_cli.flight.astronomy import DAY_S
from landing_cli.tour.records import Departure, FlybyChain
from landing_cli.tour.run_records import ChainEntry, TourRun
from landing_cli.tour.time_scales import t_s_to_utc


def summarise(entry: ChainEntry) -> dict[str, Any]:
    """Sum up a chain, as ``tour * --json`` prints it.

    Parameters
    ----------
    entry : ChainEntry
        The chain.

    Returns
    -------
    dict
        ``delta_v_m_s`` is the two-body hint; what was flown in N-body is ``nbody_delta_v_m_s``, and flybys
        and dates are of that flight where there is one.
    """
    return {"name": entry.name, **summarise_chain(entry.chain)}


def summarise_chain(chain: FlybyChain) -> dict[str, Any]:
    """Sum up a chain that has no name.

    Parameters
    ----------
    chain : FlybyChain
        The chain.

    Returns
    -------
    dict
    """
    return {
        "status": chain.status,
        "message": chain.message,
        "asteroids": len(chain.legs),
        "targets": list(chain.targets),
        "dates": [t_s_to_utc(leg.arrival_t_s) for leg in chain.best_legs],
        "delta_v_m_s": chain.delta_v_m_s,
        "nbody_delta_v_m_s": chain.nbody_delta_v_m_s,
        "duration_d": chain.duration_s / DAY_S,
        "flybys": flyby_rows(chain),
    }


def flyby_rows(chain: FlybyChain) -> list[dict[str, Any]]:
    """List the flybys of a chain with their burns.

    Parameters
    ----------
    chain : FlybyChain
        The chain.

    Returns
    -------
    list of dict
        Empty for a chain whose flybys are not known.
    """
    rows = []
    nbody = chain.nbody_legs or (None,) * len(chain.legs)
    for hint, leg, flyby in zip(chain.legs, nbody, chain.flybys, strict=False):
        rows.append(
            {
                "designation": flyby.designation,
                "date_utc": t_s_to_utc(flyby.t_s),
                "burn_utc": t_s_to_utc((leg or hint).burn_t_s),
                "delta_v_m_s": hint.size_m_s,
                "nbody_delta_v_m_s": math.nan if leg is None else leg.size_m_s,
                "revolutions": hint.revolutions,
                "speed_m_s": flyby.speed_m_s,
                "phase_angle_deg": math.degrees(flyby.phase_angle_rad),
                "geocentric_distance_km": flyby.geocentric_distance_m / 1e3,
                "diameter_m": flyby.diameter_m,
                "absolute_magnitude": flyby.absolute_magnitude,
                "apparent_magnitude": flyby.apparent_magnitude,
                "miss_km": flyby.miss_m / 1e3,
            }
        )
    return rows


def summarise_run(run: TourRun) -> dict[str, Any]:
    """Sum up a run: what was searched, how far, and what was found.

    Parameters
    ----------
    run : TourRun
        The run.

    Returns
    -------
    dict
        ``chains`` are best first; ``front`` names those that no other beats in number, delta-v and duration.
    """
    facts = run.facts
    return {
        "method": facts.method,
        "departure": _departure(facts.departure),
        "catalogue": {
            "source": facts.targets.source,
            "sha256": facts.targets.sha256,
            "rows": facts.catalogue_rows,
            "bad_rows": facts.catalogue_bad_rows,
            "targets": facts.searched_targets,
        },
        "searched": [vars(depth) for depth in run.depths],
        "chains": [summarise(entry) for entry in run.cases],
        "front": [entry.name for entry in front(run.cases)],
        "broken": [
            {"targets": list(c.targets), "delta_v_m_s": c.delta_v_m_s, "message": c.message}
            for c in run.broken
        ],
        "nearest": None if run.nearest is None else summarise_chain(run.nearest),
    }


def front(entries: Sequence[ChainEntry]) -> tuple[ChainEntry, ...]:
    """Keep the chains that no other beats in number of asteroids, N-body delta-v and duration at once.

    Parameters
    ----------
    entries : sequence of ChainEntry
        Those that were not flown are left out.

    Returns
    -------
    tuple of ChainEntry
        In their order.
    """
    flown = [entry for entry in entries if entry.chain.status == "flown"]
    costs = [_costs(entry.chain) for entry in flown]
    return tuple(
        entry
        for entry, cost in zip(flown, costs, strict=True)
        if not any(_beats(other, cost) for other in costs)
    )


def best_first(entries: Sequence[FlybyChain]) -> list[int]:
    """Order chains: most asteroids first, then least delta-v.

    Parameters
    ----------
    entries : sequence of FlybyChain
        The chains.

    Returns
    -------
    list of int
        Their places in order.
    """

    def key(place: int) -> tuple[int, float, tuple[str, ...]]:
        chain = entries[place]
        found = chain.nbody_delta_v_m_s if chain.nbody_legs is not None else chain.delta_v_m_s
        return -len(chain.legs), found, chain.targets

    return sorted(range(len(entries)), key=key)


def _departure(departure: Departure) -> dict[str, Any]:
    return {
        "date_utc": t_s_to_utc(departure.t_s),
        "geocentric_distance_km": departure.geocentric_distance_m / 1e3,
        "sun_angle_deg": math.degrees(departure.angle_rad),
        "radial_speed_m_s": departure.radial_speed_m_s,
        "position_m": departure.position_m,
        "velocity_m_s": departure.velocity_m_s,
    }


def _costs(chain: FlybyChain) -> tuple[float, float, float]:
    return -len(chain.legs), chain.nbody_delta_v_m_s, chain.duration_s


def _beats(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return all(a <= b for a, b in zip(one, other, strict=True)) and one != other

"""What a search found, in the records of a tour."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import GM_SUN_M3_S2
from landing_cli.flight.kepler import propagate_kepler
from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.tour.beam import Chains
from landing_cli.tour.records import Departure, DepthReport, FlybyChain, Leg, SearchOutcome

FloatArray = NDArray[np.float64]

_SAMPLES = 48


def outcome_of(
    levels: Sequence[Chains],
    nearest: Chains | None,
    reports: tuple[DepthReport, ...],
    catalogue: Catalogue,
    departure: Departure,
    kept_chains: int,
) -> SearchOutcome:
    """Put the chains of all lengths together, the longest first.

    Parameters
    ----------
    levels : sequence of Chains
        Of one flyby, two, and so on; each the cheapest first.
    nearest : Chains or None
        The chain that came nearest where there are no others.
    reports : tuple of DepthReport
        Of each level.
    catalogue : Catalogue
        The targets.
    departure : Departure
        Where the spacecraft sets out.
    kept_chains : int
        Chains at most: as many of each length, and what is left over to the longest.

    Returns
    -------
    SearchOutcome
        No sequence of targets twice.
    """
    distinct = [_distinct(chains) for chains in levels]
    share = kept_chains // max(1, len(levels))
    counts = [min(share, len(chains)) for chains in distinct]
    for place in reversed(range(len(distinct))):
        counts[place] += min(kept_chains - sum(counts), len(distinct[place]) - counts[place])
    chosen = [chains.take(np.arange(count)) for chains, count in zip(distinct, counts, strict=True)]
    found = [
        chain_record(chains, row, catalogue, departure)
        for chains in reversed(chosen)
        for row in range(len(chains))
    ]
    least = None if nearest is None or found else chain_record(nearest, 0, catalogue, departure)
    return SearchOutcome(tuple(found), reports, least)


def chain_record(chains: Chains, row: int, catalogue: Catalogue, departure: Departure) -> FlybyChain:
    """Turn a row into a record.

    Parameters
    ----------
    chains : Chains
        Of any length.
    row : int
        Which.
    catalogue : Catalogue
        The targets.
    departure : Departure
        Where the spacecraft sets out.

    Returns
    -------
    FlybyChain
        A hint; its flybys are told by the re-flight.
    """
    legs = []
    for place, target in enumerate(chains.targets[row]):
        leg = chains.legs[row, place]
        turns = (int(leg[8]) + 1) // 2
        if place == 0:
            turns = _turns(chains.first.state[row], chains.first.arrival_t_s[row] - leg[0])
        legs.append(
            Leg(
                target=int(target),
                designation=catalogue.designations[target],
                burn_t_s=float(leg[0]),
                arrival_t_s=float(leg[1]),
                delta_v_m_s=leg[2:5].copy(),
                revolutions=turns,
            )
        )
    return FlybyChain(departure.t_s, tuple(legs), None, (), "hint")


def _distinct(chains: Chains) -> Chains:
    _, place = np.unique(chains.targets, axis=0, return_index=True)
    return chains.take(np.sort(place))


def _turns(state: FloatArray, flown_s: float) -> int:
    """Whole revolutions of a flight, told backwards from where it ends."""
    states = propagate_kepler(state, -flown_s * np.linspace(0.0, 1.0, _SAMPLES), GM_SUN_M3_S2)
    swept = np.unwrap(np.arctan2(states[:, 1], states[:, 0]))
    return int(abs(swept[-1] - swept[0]) / (2.0 * math.pi))

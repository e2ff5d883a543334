"""Counts, probabilities with their intervals, and what the verdicts follow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.records import Verdict
from landing_cli.studies.disperse.records import (
    FACET_COLUMNS,
    Drawing,
    FloatArray,
    Verdicts,
    drivers_of,
    dtype_of,
)

_ORDER = (Verdict.UNREACHABLE, Verdict.UNRESOLVED, Verdict.REACHABLE)
_FACETS_AT_ONCE = 2048


def clopper_pearson(
    successes: NDArray[np.integer], doubtful: NDArray[np.integer], trials: int, confidence: float
) -> tuple[FloatArray, FloatArray]:
    """Interval of a probability (Clopper and Pearson 1934) that covers at least as often as it says.

    Parameters
    ----------
    successes, doubtful : (n,) int
        Trials that succeeded, and those of which it is not known.
    trials : int
        How many of all kinds.
    confidence : float
        Least probability that the interval holds the true value, whatever that is.

    Returns
    -------
    low, high : (n,) float
        The interval is widened to hold the answer with every doubtful trial taken either way.
    """
    from scipy.special import betaincinv

    tail = 0.5 * (1.0 - confidence)
    least = np.asarray(successes, dtype=np.float64)
    most = least + doubtful
    low = np.where(least > 0, betaincinv(np.maximum(least, 1.0), trials - least + 1.0, tail), 0.0)
    high = np.where(most < trials, betaincinv(most + 1.0, np.maximum(trials - most, 1.0), 1.0 - tail), 1.0)
    return low, high


def count(verdicts: Verdicts, verdict: Verdict, axis: int) -> NDArray[np.int64]:
    """How often a verdict occurs along an axis of (samples, facets)."""
    return np.asarray((verdicts == verdict).sum(axis=axis, dtype=np.int64))


def facet_rows(verdicts: Verdicts, drawing: Drawing, deviations: FloatArray) -> NDArray[np.void]:
    """Sum the samples of a case up, facet by facet.

    Parameters
    ----------
    verdicts : (samples, facets) uint8
        Of a case.
    drawing : Drawing
        How the samples were drawn.
    deviations : (samples, 9) float
        What they were.

    Returns
    -------
    (facets,) structured array of FACET_COLUMNS
    """
    samples, facets = verdicts.shape
    rows = np.zeros(facets, dtype=dtype_of(FACET_COLUMNS))
    rows["facet"] = np.arange(facets)
    for verdict in Verdict:
        rows[verdict.name.lower()] = count(verdicts, verdict, 0)
    rows["probability"] = rows["reachable"] / samples
    rows["probability_low"], rows["probability_high"] = clopper_pearson(
        rows["reachable"], rows["unresolved"], samples, drawing.confidence
    )
    correlation = verdict_correlations(verdicts, deviations)
    rows["driver"], rows["driver_correlation"] = strongest(correlation, drawing)
    return rows


def verdict_correlations(verdicts: Verdicts, deviations: FloatArray) -> FloatArray:
    """Spearman's rank correlation of every facet's verdict with each drawn quantity.

    Parameters
    ----------
    verdicts : (samples, facets) uint8
        Ranked unreachable, unresolved, reachable; equal ones share their mean rank.
    deviations : (samples, 9) float
        What was drawn.

    Returns
    -------
    (9, facets) float
        NaN where the verdict or the quantity is always the same.
    """
    ranks = _centred_ranks(deviations)
    samples, facets = verdicts.shape
    found = np.empty((ranks.shape[0], facets))
    for begin in range(0, facets, _FACETS_AT_ONCE):
        part = verdicts[:, begin : begin + _FACETS_AT_ONCE]
        counts = np.stack([count(part, verdict, 0) for verdict in _ORDER])
        mean_rank = np.cumsum(counts, axis=0) - 0.5 * (counts - 1) - 0.5 * (samples + 1)
        product = sum(
            rank * (ranks @ (part == verdict).astype(np.float64))
            for verdict, rank in zip(_ORDER, mean_rank, strict=True)
        )
        length = np.sqrt((counts * mean_rank**2).sum(axis=0))
        found[:, begin : begin + _FACETS_AT_ONCE] = np.divide(
            product,
            length,
            out=np.full_like(found[:, begin : begin + _FACETS_AT_ONCE], np.nan),
            where=length > 0,
        )
    return found


def rank_correlations(values: FloatArray, deviations: FloatArray) -> FloatArray:
    """Spearman's rank correlation of a number a sample with each drawn quantity, (9,); NaN as above."""
    own = _centred_ranks(values[:, None])[0]
    return np.asarray(_centred_ranks(deviations) @ own)


def strongest(correlation: FloatArray, drawing: Drawing) -> tuple[NDArray[np.uint8], FloatArray]:
    """Find the quantity of the largest correlation.

    Parameters
    ----------
    correlation : (9, n) float
        NaN where there is none.
    drawing : Drawing
        How the state's axes are named.

    Returns
    -------
    driver : (n,) uint8
        Values of Driver; NONE where every correlation is NaN.
    value : (n,) float
        Its correlation, or NaN.
    """
    # of equals, as few samples make them, the first: rounding must not choose
    size = np.round(np.where(np.isfinite(correlation), np.abs(correlation), -1.0), 9)
    place = size.argmax(axis=0)
    value = np.take_along_axis(correlation, place[None], 0)[0]
    names = np.array(drivers_of(drawing.spread.axes), dtype=np.uint8)
    return np.where(np.isfinite(value), names[place], 0).astype(np.uint8), value


def _centred_ranks(values: FloatArray) -> FloatArray:
    """Mean ranks of each column, centred and scaled to length 1, (columns, n); NaN where all are equal."""
    rows = []
    for column in np.asarray(values, dtype=np.float64).T:
        _, place, counts = np.unique(column, return_inverse=True, return_counts=True)
        rank = (np.cumsum(counts) - 0.5 * (counts - 1))[place] - 0.5 * (len(column) + 1)
        length = float(np.sqrt((rank**2).sum()))
        rows.append(rank / length if length > 0.0 else np.full(len(column), np.nan))
    return np.stack(rows)

"""What the samples say together: the spread of the domain's area, and intervals that narrow with samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from landing_cli.reach.figures.parts import body_name
from landing_cli.reach.records import Verdict
from landing_cli.results import plotting
from landing_cli.studies.disperse.records import CaseDispersion, FloatArray
from landing_cli.studies.disperse.statistics import clopper_pearson
from landing_cli.studies.disperse.summary import AREA_PERCENTILES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Facets are shown whose probabilities are nearest to these.
TELLING = (0.1, 0.5, 0.9)
_POINTS = 160


def area_figure(result: CaseDispersion) -> Figure:
    """Show how the area of the reachable domain is spread over the samples.

    Parameters
    ----------
    result : CaseDispersion
        The case.

    Returns
    -------
    Figure
    """
    area_km2 = result.samples["reachable_area_m2"] / 1e6
    figure = plotting.new_figure(7.0, 3.6)
    spread = result.summary["reachable_area_m2"]
    plotting.add_title(
        figure,
        f"{body_name(result.case)}, {result.case.name}: area of the reachable domain",
        f"{result.drawing.samples} samples; mean {spread['mean'] / 1e6:.4g} km², "
        f"90 % within {spread['p05'] / 1e6:.4g} to {spread['p95'] / 1e6:.4g} km²",
    )
    axes = figure.add_axes((0.1, 0.15, 0.86, 0.64))
    bins = int(np.clip(np.sqrt(len(area_km2)) * 1.5, 5, 60))
    axes.hist(area_km2, bins=bins, color=plotting.SKY, edgecolor="white", linewidth=0.4)
    for percentile in AREA_PERCENTILES:
        at = spread[f"p{percentile:02d}"] / 1e6
        axes.axvline(
            at, color=plotting.INK, lw=1.3 if percentile == 50 else 0.9, ls="-" if percentile == 50 else "--"
        )
        axes.annotate(
            f"{percentile} %",
            (at, 1.0),
            (3, -2),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            va="top",
            fontsize=8,
        )
    axes.set(xlabel="reachable area (km²)", ylabel="samples")
    return figure


def telling_facets(result: CaseDispersion) -> list[int]:
    """Choose facets whose probabilities are nearest to TELLING, each once."""
    probability = result.facets["probability"]
    return list(dict.fromkeys(int(np.argmin(np.abs(probability - wanted))) for wanted in TELLING))


def convergence_figure(result: CaseDispersion, facets: Sequence[int]) -> Figure:
    """Show how the intervals of some facets narrow as samples come in.

    Parameters
    ----------
    result : CaseDispersion
        The case.
    facets : sequence of int
        Which ones.

    Returns
    -------
    Figure
    """
    samples = result.drawing.samples
    counts = np.unique(np.geomspace(1, samples, _POINTS).round().astype(np.int64))
    figure = plotting.new_figure(7.0, 3.9)
    plotting.add_title(
        figure,
        f"{body_name(result.case)}, {result.case.name}: the probability with the samples so far",
        f"shaded: {100 * result.drawing.confidence:g} % interval (Clopper-Pearson)",
    )
    axes = figure.add_axes((0.1, 0.14, 0.86, 0.67))
    for facet, colour in zip(facets, (plotting.BLUE, plotting.GREEN, plotting.ORANGE), strict=False):
        mean, low, high = running_interval(result, facet, counts)
        axes.fill_between(counts, low, high, color=colour, alpha=0.22, lw=0)
        axes.plot(counts, mean, color=colour, label=f"facet {facet}: {100 * mean[-1]:.3g} %")
    axes.set(xscale="log", xlim=(1, max(samples, 2)), ylim=(0, 1), xlabel="samples")
    axes.set_ylabel("probability of being reachable")
    axes.grid(True)
    axes.legend(
        loc="upper left", bbox_to_anchor=(0.01, 0.99), frameon=True, framealpha=0.85, edgecolor="none"
    )
    return figure


def running_interval(
    result: CaseDispersion, facet: int, counts: np.ndarray[tuple[int], np.dtype[np.int64]]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Probability of a facet and its interval from the first samples alone.

    Parameters
    ----------
    result : CaseDispersion
        The case.
    facet : int
        Which one.
    counts : (k,) int
        Numbers of samples.

    Returns
    -------
    mean, low, high : (k,) float
    """
    verdicts = result.verdicts[:, facet]
    reached = np.cumsum(verdicts == Verdict.REACHABLE)[counts - 1]
    open_ = np.cumsum(verdicts == Verdict.UNRESOLVED)[counts - 1]
    ends = [
        clopper_pearson(np.array([r]), np.array([u]), int(n), result.drawing.confidence)
        for r, u, n in zip(reached, open_, counts, strict=True)
    ]
    low, high = np.array(ends)[:, :, 0].T
    return reached / counts, low, high

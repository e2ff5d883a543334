"""How good section and expansion is against a traversal, and how much its free azimuth matters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from landing_cli.reach.section import BoolArray, FloatArray, IntArray, section_and_expansion


class DomainComparison(NamedTuple):
    """How far a domain is from the true one: wrong facets, and shared area over joint area."""

    misclassified: int
    iou: float


def compare_domains(found: BoolArray, truth: BoolArray, areas_m2: FloatArray) -> DomainComparison:
    """Compare two domains over the same facets.

    Parameters
    ----------
    found, truth : (m,) bool
        Domains.
    areas_m2 : (m,) float, m2
        Facet areas, the weights of the intersection over union.

    Returns
    -------
    DomainComparison
        An IoU of 1 where both are empty.
    """
    union = float(areas_m2[found | truth].sum())
    shared = float(areas_m2[found & truth].sum())
    return DomainComparison(int(np.sum(found != truth)), shared / union if union else 1.0)


@dataclass(frozen=True, eq=False)
class SectionSweep:
    """Section and expansion at several azimuths against a known truth; one entry an azimuth.

    Attributes
    ----------
    azimuths_deg : (k,) float, degree
    section_count, ring_count, expansion_count, expansions, solves : (k,) int
        P(d), P(r), P(e), n and N of the paper's Table 1.
    ratio : (k,) float
        N / N_f.
    misclassified : (k,) int
    iou : (k,) float
    closed : (k,) bool
    """

    azimuths_deg: FloatArray
    section_count: IntArray
    ring_count: IntArray
    expansion_count: IntArray
    expansions: IntArray
    solves: IntArray
    ratio: FloatArray
    misclassified: IntArray
    iou: FloatArray
    closed: BoolArray


def section_sweep(
    centroids_m: FloatArray,
    neighbours: IntArray,
    initial_position_m: ArrayLike,
    h_m: float,
    azimuths_deg: ArrayLike,
    truth: BoolArray,
    areas_m2: FloatArray,
) -> SectionSweep:
    """Repeat section and expansion at many azimuths, with the verdicts of a traversal for answers.

    Parameters
    ----------
    centroids_m, neighbours, initial_position_m, h_m
        As for :func:`section_and_expansion`.
    azimuths_deg : (k,) float, degree
        Azimuths of the section plane.
    truth : (m,) bool
        Whether each facet is feasible.
    areas_m2 : (m,) float, m2
        Facet areas.

    Returns
    -------
    SectionSweep
    """
    azimuths = np.asarray(azimuths_deg, dtype=np.float64)
    runs = [
        section_and_expansion(centroids_m, neighbours, initial_position_m, h_m, azimuth, lambda f: truth[f])
        for azimuth in azimuths
    ]
    compared = [compare_domains(run.domain, truth, areas_m2) for run in runs]
    return SectionSweep(
        azimuths_deg=azimuths,
        section_count=np.array([len(run.section_facets) for run in runs]),
        ring_count=np.array([len(run.ring_facets) for run in runs]),
        expansion_count=np.array([len(run.expansion_facets) for run in runs]),
        expansions=np.array([run.expansions for run in runs]),
        solves=np.array([run.solves for run in runs]),
        ratio=np.array([run.ratio for run in runs]),
        misclassified=np.array([c.misclassified for c in compared]),
        iou=np.array([c.iou for c in compared]),
        closed=np.array([run.closed for run in runs]),
    )

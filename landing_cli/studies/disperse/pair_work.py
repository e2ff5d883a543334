"""Facets of all samples of all cases as one list of work.

A pair is one facet of one sample of one case, written as one integer ((case times samples plus sample) times
facets plus facet); a chunk of work is a range of them, which can be cut anywhere. A pair's verdict depends on
nothing but the pair: the same come out for any number of jobs, any backend and any order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landing_cli.reach.facet_work import solve_items
from landing_cli.reach.free_descent import PreparedCase, solve_verdicts
from landing_cli.reach.records import Verdict
from landing_cli.studies.disperse.dispersed import begins_inside, dispersed_case, prepare_dispersed
from landing_cli.studies.disperse.records import FloatArray, Verdicts

CHUNK_PAIRS = 1024


@dataclass(frozen=True, eq=False)
class Span:
    """Verdicts of consecutive pairs.

    Attributes
    ----------
    first : int
        The first pair.
    verdicts : (k,) uint8
    """

    first: int
    verdicts: Verdicts


@dataclass(frozen=True, eq=False)
class PairWork:
    """Solves ranges of pairs; it pickles.

    Attributes
    ----------
    nominal : tuple of PreparedCase
        Every case, without deviation.
    turns : tuple of (3, 3) float
        Axes that each case's state is dispersed along.
    deviations : (samples, 9) float, SI
        Of every sample.
    """

    nominal: tuple[PreparedCase, ...]
    turns: tuple[FloatArray, ...]
    deviations: FloatArray

    @property
    def facets(self) -> int:
        """Facets of the mesh."""
        return len(self.nominal[0].shared.centroids_m)

    @property
    def pairs(self) -> int:
        """How many there are."""
        return len(self.nominal) * len(self.deviations) * self.facets

    def prepared(self, case: int, sample: int) -> PreparedCase:
        """Return a case with a sample's deviations, ready for the solver."""
        nominal = self.nominal[case]
        dispersed = dispersed_case(nominal.case, self.turns[case], self.deviations[sample])
        return prepare_dispersed(nominal, dispersed)

    def __call__(self, pairs: range) -> Span:
        """Find the verdicts of consecutive pairs."""
        parts, at = [], pairs.start
        while at < pairs.stop:
            which, facet = divmod(at, self.facets)
            last = min(facet + pairs.stop - at, self.facets)
            prepared = self.prepared(*divmod(which, len(self.deviations)))
            parts.append(verdicts_of(prepared, np.arange(facet, last)))
            at += last - facet
        return Span(pairs.start, np.concatenate(parts))


def verdicts_of(prepared: PreparedCase, facets: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Verdicts:
    """Find the verdicts of ascending facets of a prepared case, as `reach run` does.

    A case that begins inside the keep-out ellipsoid reaches nothing; that is not left to the solver.
    """
    if begins_inside(prepared.case):
        return np.full(len(facets), Verdict.UNREACHABLE, dtype=np.uint8)
    if prepared.case.descent == "free":
        return solve_verdicts(prepared, facets)
    solved = solve_items((prepared,), len(prepared.shared.centroids_m), facets)
    return np.asarray(solved.rows["verdict"])


def in_chunks(pairs: int) -> list[range]:
    """Cut all pairs into ranges of fixed size."""
    return [range(at, min(at + CHUNK_PAIRS, pairs)) for at in range(0, pairs, CHUNK_PAIRS)]

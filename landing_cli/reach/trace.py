"""The reachable domain by following its boundary, with solves that grow like the square root of the facets.

The search asks a callable for the verdict and the least thrust level tau of facets, about each at most once,
and knows nothing about how they are found. The level is 1 at the boundary and smooth in a facet's place and
normal (:mod:`landing_cli.reach.level_estimate`), so what was asked tells where else the boundary can be:

- Seeds cover the surface evenly, SEEDS for each root of a facet: one in each of as many clusters of
  neighbouring facets, by the tree of :func:`landing_cli.body.bvh.build_surface_index`.
- Branch and bound over that tree: where the level is estimated within DOUBT errors of 1, the cluster may hold
  boundary. It is cut in BRANCHES, and in each part the most doubtful facet is asked. What lies clear of 1 by
  twice as much is left alone. An island of any size is found when its levels stand out of the estimates by
  less than that; a steeper one that no asked facet touches is what the method can miss.
- At single facets the boundary is followed along edges: wherever a reachable facet, by its verdict or else by
  its estimate, lies beside one that is not, both are asked, until there is no such edge whose two facets were
  not asked. What lies within then takes the verdict of the facets around it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.level_estimate import FloatArray, estimate

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

SEEDS = 4.0
BRANCHES = 4
DOUBT, SETTLED = 2.0, 4.0
# Two solvers agree on the logarithm of a level no better than this: nearer to 1, only the verdict tells.
LEVEL_NOISE = 1e-3


class Answers(NamedTuple):
    """What is known about some facets once they were asked."""

    reachable: BoolArray  # (k,)
    resolved: BoolArray  # (k,) whether the verdict is known
    level: FloatArray  # (k,) least thrust level over the bound; NaN where it is not known


Ask = Callable[[IntArray], Answers]


class Ground(NamedTuple):
    """The surface as the search sees it."""

    features: FloatArray  # (m, 6) from level_estimate.features
    neighbours: IntArray  # (m, 3) facets across the edges
    order: IntArray  # (m,) the facets such that any run of them is a cluster


@dataclass(frozen=True, eq=False)
class TraceResult:
    """What was asked, and the domain that follows.

    Attributes
    ----------
    seeds : (s,) int
        Facets of the covering.
    asked, resolved : (m,) bool
        Which facets were asked, and of which the verdict is known.
    domain : (m,) bool
        The reachable domain: verdicts where there are any, else those around.
    rounds : int
        How often facets were asked for.
    """

    seeds: IntArray
    asked: BoolArray
    resolved: BoolArray
    domain: BoolArray
    rounds: int

    @property
    def solves(self) -> int:
        """Number of facets asked."""
        return int(self.asked.sum())

    @property
    def ratio(self) -> float:
        """The share of the facets that were asked."""
        return self.solves / len(self.asked)


def trace_domain(ground: Ground, ask: Ask) -> TraceResult:
    """Find the reachable domain from few solved facets.

    Parameters
    ----------
    ground : Ground
        The surface.
    ask : callable
        ``ask(facets)`` with (k,) int, ascending, tells about these facets.

    Returns
    -------
    TraceResult
    """
    count = len(ground.order)
    search = _Search(ground, ask)
    clusters = min(count, int(np.ceil(SEEDS * np.sqrt(count))))
    seeds = ground.order[((np.arange(clusters) + 0.5) * count / clusters).astype(np.int64)]
    search.ask(seeds)
    while True:
        clusters = min(count, BRANCHES * clusters)
        search.estimate()
        wanted = search.wanted()
        if clusters < count:
            wanted = search.foremost(wanted, clusters)
        elif len(wanted) == 0:
            break
        search.ask(wanted)
    return TraceResult(np.sort(seeds), search.asked, search.resolved, search.inside, search.rounds)


class _Search:
    """What is known so far, and what is believed of the rest."""

    def __init__(self, ground: Ground, ask: Ask) -> None:
        count = len(ground.order)
        self._ground = ground
        self._ask = ask
        self._slot = np.empty(count, dtype=np.int64)
        self._slot[ground.order] = np.arange(count)
        self._value = np.full(count, np.nan)  # logarithm of the level, of facets asked
        self._doubt = np.full(count, np.inf)  # distance of the estimate from 0, in errors
        self._open = np.ones(count, dtype=bool)  # estimates that may still change sides
        self.asked = np.zeros(count, dtype=bool)
        self.resolved = np.zeros(count, dtype=bool)
        self.inside = np.zeros(count, dtype=bool)  # verdict or estimate
        self.rounds = 0

    def ask(self, facets: IntArray) -> None:
        """Ask for facets, none of which has been asked."""
        if len(facets) == 0:
            return
        facets = np.sort(facets)
        found = self._ask(facets)
        self.rounds += 1
        self.asked[facets] = True
        self.inside[facets], self.resolved[facets] = found.reachable, found.resolved
        with np.errstate(divide="ignore", invalid="ignore"):
            value = np.log(found.level)
        self._value[facets] = np.where(np.isfinite(value), value, np.nan)
        self._open[facets] = False

    def estimate(self) -> None:
        """Estimate the open facets anew, and close those that are clear of the boundary."""
        features, facets = self._ground.features, np.flatnonzero(self._open)
        known = np.flatnonzero(np.isfinite(self._value))
        if len(known) == 0:
            return
        value, error = estimate(features[known], self._value[known], features[facets])
        self.inside[facets] = value < 0.0
        self._doubt[facets] = np.abs(value) / np.hypot(error, LEVEL_NOISE)
        self._open[facets] = self._doubt[facets] <= SETTLED

    def wanted(self) -> IntArray:
        """List unasked facets that may be boundary, or that the boundary as it is believed runs past."""
        around = self._ground.neighbours
        front = (self.inside[:, None] != self.inside[around]).any(axis=1)
        self._open |= front & ~self.asked
        return np.flatnonzero(~self.asked & (front | (self._doubt <= DOUBT)))

    def foremost(self, facets: IntArray, clusters: int) -> IntArray:
        """Pick the most doubtful facet of each cluster."""
        cluster = self._slot[facets] * clusters // len(self._slot)
        ranked = np.lexsort((facets, self._doubt[facets], cluster))
        first = np.concatenate([[True], np.diff(cluster[ranked]) > 0])[: len(ranked)]
        return facets[ranked[first]]

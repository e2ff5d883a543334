"""Where a facet's verdict changes: brackets on the ladder, halved until nothing lies between their ends.

A verdict is one of three, so the middle of a bracket may differ from both its ends; then both halves are
brackets. Halving by the verdict itself, not by the root of a fitted margin, makes every end a pair of answers
that `reach run` gives at those two times, whatever the shape of the margin in between. It asks for as many
solves as there are bits between step and tolerance (6 from 25 s to 0.4 s), and facets of the same step share
their cases in the first of them. The root of the least thrust level would spare the early halvings, which are
the cheap ones: close to the end a verdict takes the fine time grid, on which the level is no cheaper to find.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]
Verdicts = NDArray[np.uint8]


class Brackets(NamedTuple):
    """Pairs of places between which a verdict changes; a series is a facet of a state.

    ``series``, ``low`` and ``high`` are (n,) int, ``before`` and ``after`` (n,) uint8: the verdicts there.
    """

    series: IntArray
    low: IntArray
    high: IntArray
    before: Verdicts
    after: Verdicts

    def taken(self, chosen: NDArray[np.bool_]) -> Brackets:
        """Return some of them."""
        return Brackets(
            self.series[chosen],
            self.low[chosen],
            self.high[chosen],
            self.before[chosen],
            self.after[chosen],
        )


def wide(brackets: Brackets) -> NDArray[np.bool_]:
    """Which brackets have a place between their ends, (n,) bool."""
    return np.asarray(brackets.high - brackets.low > 1)


def middles(brackets: Brackets) -> IntArray:
    """Places in the middle of brackets, (n,) int."""
    return (brackets.low + brackets.high) // 2


def halves(brackets: Brackets, middle: Verdicts) -> Brackets:
    """Keep the halves of brackets in which the verdict changes.

    Parameters
    ----------
    brackets : Brackets
        Wide ones.
    middle : (n,) uint8
        The verdicts at their middles.

    Returns
    -------
    Brackets
    """
    at = middles(brackets)
    lower = brackets._replace(high=at, after=middle)
    upper = brackets._replace(low=at, before=middle)
    both = Brackets(
        np.concatenate([lower.series, upper.series]),
        np.concatenate([lower.low, upper.low]),
        np.concatenate([lower.high, upper.high]),
        np.concatenate([lower.before, upper.before]),
        np.concatenate([lower.after, upper.after]),
    )
    return both.taken(both.before != both.after)

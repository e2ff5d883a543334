"""A chunk on its way: how often it killed its worker, and how it is cut to find the culprit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

T = TypeVar("T")

KILLS_BEFORE_BISECTION = 2


@dataclass(frozen=True)
class LostChunk(Generic[T]):
    """Items that no worker could finish.

    Attributes
    ----------
    items : sequence
        The part of the chunk that is lost: one item where bisection found the culprit.
    reason : str
        Why, in words for the user.
    """

    items: Sequence[T]
    reason: str


@dataclass(frozen=True)
class Attempt(Generic[T]):
    """A chunk, or a piece of one, with the number of workers it has killed."""

    index: int
    items: Sequence[T]
    kills: int = 0

    def after_kill(self) -> list[Attempt[T]]:
        """What to try next once more a worker died on it; nothing left when a single item is guilty.

        Returns
        -------
        list of Attempt
            Itself after the first kill, its two halves after the second. A half has one kill
            to its name already, but a single item gets two trials of its own, so that a worker
            that was killed from outside cannot condemn it.
        """
        if self.kills + 1 < KILLS_BEFORE_BISECTION:
            return [replace(self, kills=self.kills + 1)]
        if len(self.items) <= 1:
            return []
        middle = len(self.items) // 2
        halves = (self.items[:middle], self.items[middle:])
        return [Attempt(self.index, half, kills=0 if len(half) == 1 else 1) for half in halves]

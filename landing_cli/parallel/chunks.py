"""A chunk on its way: how often it killed its worker, and how it is cut to find the culprit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

C = TypeVar("C")

KILLS_BEFORE_BISECTION = 2


@dataclass(frozen=True)
class LostChunk(Generic[C]):
    """Items that no worker could finish.

    Attributes
    ----------
    items : sequence or array
        The part of the chunk that is lost: one item where bisection found the culprit.
    reason : str
        Why, in words for the user.
    """

    items: C
    reason: str


@dataclass(frozen=True)
class Attempt(Generic[C]):
    """A chunk, or a piece of one, with the number of workers it has killed."""

    index: int
    items: C
    kills: int = 0

    def after_kill(self) -> list[Attempt[C]]:
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
        items: Any = self.items
        if len(items) <= 1:
            return []
        middle = len(items) // 2
        halves = (items[:middle], items[middle:])
        return [Attempt(self.index, half, kills=0 if len(half) == 1 else 1) for half in halves]

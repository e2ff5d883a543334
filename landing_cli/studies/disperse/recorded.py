"""Verdicts found in chunks, each recorded as it comes, a byte a pair: a kill loses only those in flight."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing

import numpy as np

from landing_cli.errors import InputRefused
from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.reach.records import Verdict
from landing_cli.results.journal import Journal
from landing_cli.studies.disperse.pair_work import Span
from landing_cli.studies.disperse.records import Verdicts

UNKNOWN = 255


def solve_recorded(
    journal: Journal,
    pairs: int,
    chunks: Sequence[range],
    work: Callable[[range], Span],
    plan: WorkPlan,
    told: Callable[[int], None],
) -> tuple[Verdicts, dict[int, str]]:
    """Find the verdicts of all pairs in chunks, but take over those that the journal holds.

    Parameters
    ----------
    journal : Journal
        Open; every chunk is recorded in it before the next is awaited.
    pairs : int
        How many there are.
    chunks : sequence of range
        All of them, each once.
    work : callable
        Finds the verdicts of a range, picklable.
    plan : WorkPlan
        Where to solve.
    told : callable
        Told the number of pairs that became known.

    Returns
    -------
    (pairs,) uint8
        Unresolved where a pair was lost.
    dict of int to str
        The lost pairs and why. They are not recorded, so that the next run tries them again.

    Raises
    ------
    InputRefused
        If the journal holds what this run cannot have recorded.
    """
    verdicts = _recorded(journal, pairs)
    told(int((verdicts != UNKNOWN).sum()))
    left = [piece for chunk in chunks for piece in _unknown(verdicts, chunk)]
    lost: dict[int, str] = {}
    with closing(run_chunks(work, left, plan)) as answers:
        for _, answer in answers:
            if isinstance(answer, LostChunk):
                lost |= dict.fromkeys(answer.items, answer.reason)
                told(len(answer.items))
                continue
            first, found = answer.first, answer.verdicts
            journal.append(f"verdicts/{first}", {"first": np.array([first]), "verdicts": found})
            verdicts[first : first + len(found)] = found
            told(len(found))
    verdicts[verdicts == UNKNOWN] = Verdict.UNRESOLVED
    return verdicts, lost


def _recorded(journal: Journal, pairs: int) -> Verdicts:
    """Verdicts that the journal holds; UNKNOWN elsewhere."""
    verdicts = np.full(pairs, UNKNOWN, dtype=np.uint8)
    for arrays in journal.records.values():
        first, found = arrays.get("first"), arrays.get("verdicts")
        if (
            first is None
            or found is None
            or first.shape != (1,)
            or found.ndim != 1
            or found.dtype != np.uint8
        ):
            raise _unfit(journal, "holds other records than this version writes")
        at = int(first[0])
        place = verdicts[at : at + len(found)] if at >= 0 else verdicts[:0]
        if len(place) != len(found) or (place != UNKNOWN).any() or not np.isin(found, list(Verdict)).all():
            raise _unfit(journal, "holds pairs that this run never asks for, or one of them twice")
        place[:] = found
    return verdicts


def _unknown(verdicts: Verdicts, chunk: range) -> list[range]:
    """The parts of a chunk that are not known yet."""
    open_ = np.concatenate([[False], verdicts[chunk.start : chunk.stop] == UNKNOWN, [False]])
    ends = chunk.start + np.flatnonzero(open_[1:] != open_[:-1])
    return [range(a, b) for a, b in zip(ends[::2].tolist(), ends[1::2].tolist(), strict=True)]


def _unfit(journal: Journal, what: str) -> InputRefused:
    return InputRefused(what, where=str(journal.path), fix="start over with --force")

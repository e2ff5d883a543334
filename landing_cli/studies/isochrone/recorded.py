"""Samples solved in chunks, each recorded as it comes, so that a kill loses only those in flight."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.reach.records import Verdict
from landing_cli.results.journal import Journal
from landing_cli.studies.isochrone.records import SAMPLE_DTYPE, Rows

Items = NDArray[np.int64]


def solve_recorded(
    journal: Journal,
    stage: str,
    chunks: Sequence[Rows],
    solve: Callable[[Rows], Rows],
    owners: Callable[[Items], Items],
    plan: WorkPlan,
    told: Callable[[int], None],
) -> tuple[Rows, dict[int, str]]:
    """Solve questions in chunks, but take over those that the journal holds.

    Parameters
    ----------
    journal : Journal
        Open; every chunk is recorded in it before the next is awaited.
    stage : str
        Names this part of the run in the journal.
    chunks : sequence of structured arrays with a field ``item``
        What to ask, each item once.
    solve : callable
        Answers some questions by one or more samples, picklable; what it finds for a question depends on
        nothing but the question.
    owners : callable
        Tells the question that a sample belongs to, by their items.
    plan : WorkPlan
        Where to solve.
    told : callable
        Told the number of samples that became known.

    Returns
    -------
    structured array of SAMPLE_DTYPE
        Ascending; none of questions that were lost.
    dict of int to str
        The items of lost questions and why. They are not recorded, so that the next run tries them again.

    Raises
    ------
    InputRefused
        If the journal holds what this run cannot have recorded.
    """
    parts = [_decoded(a, journal) for key, a in journal.records.items() if key.startswith(f"{stage}/")]
    known = np.concatenate([np.zeros(0, dtype=np.int64), *(part["item"] for part in parts)])
    asked = np.concatenate([known[:0], *(chunk["item"] for chunk in chunks)])
    answered = owners(known)
    if len(np.unique(known)) != len(known) or not np.isin(answered, asked).all():
        raise _unfit(journal, "holds questions that this run never asks, or one of them twice")
    told(len(known))
    left = [chunk[~np.isin(chunk["item"], answered)] for chunk in chunks]
    lost: dict[int, str] = {}
    with closing(run_chunks(solve, [chunk for chunk in left if len(chunk)], plan)) as answers:
        for _, answer in answers:
            if isinstance(answer, LostChunk):
                lost |= dict.fromkeys(answer.items["item"].tolist(), answer.reason)
                continue
            journal.append(f"{stage}/{owners(answer['item']).min()}", {"samples": answer})
            parts.append(answer)
            told(len(answer))
    rows = np.concatenate([np.zeros(0, dtype=SAMPLE_DTYPE), *parts])
    return rows[np.argsort(rows["item"])], lost


def _decoded(arrays: Mapping[str, NDArray[Any]], journal: Journal) -> Rows:
    rows = arrays.get("samples")
    if rows is None or rows.dtype != SAMPLE_DTYPE or rows.ndim != 1:
        raise _unfit(journal, "holds other columns than this version writes")
    if not np.isin(rows["verdict"], list(Verdict)).all():
        raise _unfit(journal, "holds a verdict without a meaning")
    return rows


def _unfit(journal: Journal, told: str) -> InputRefused:
    return InputRefused(told, where=str(journal.path), fix="start over with --force")

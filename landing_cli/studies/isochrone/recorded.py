"""Samples solved in chunks, each recorded as it comes, so that a kill loses only those in flight."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.reach.facet_work import in_chunks
from landing_cli.reach.records import Verdict
from landing_cli.results.journal import Journal
from landing_cli.studies.isochrone.records import SAMPLE_DTYPE, Rows
from landing_cli.studies.isochrone.work import Items, blank_samples


def solve_recorded(
    journal: Journal,
    stage: str,
    items: Items,
    solve: Callable[[Items], Rows],
    plan: WorkPlan,
    told: Callable[[int], None],
) -> tuple[Rows, dict[int, str]]:
    """Solve items in chunks, but take over those that the journal holds.

    Parameters
    ----------
    journal : Journal
        Open; every chunk is recorded in it before the next is awaited.
    stage : str
        Names this round in the journal.
    items : (n,) int
        What to solve, ascending.
    solve : callable
        Solves some items, picklable; an item's answer depends on nothing but the item.
    plan : WorkPlan
        Where to solve.
    told : callable
        Told the number of items that became known.

    Returns
    -------
    (n,) structured array of SAMPLE_DTYPE
        Ascending; unresolved where an item was lost.
    dict of int to str
        The lost items and why. They are not recorded, so that the next run tries them again.

    Raises
    ------
    InputRefused
        If the journal holds what this run cannot have recorded.
    """
    parts = [_decoded(a, journal) for key, a in journal.records.items() if key.startswith(f"{stage}/")]
    known = np.concatenate([part["item"] for part in parts]) if parts else np.zeros(0, dtype=np.int64)
    if len(np.unique(known)) != len(known) or not np.isin(known, items).all():
        raise _unfit(journal, "holds items that this run never asks for, or one of them twice")
    told(len(known))
    left = in_chunks(items[~np.isin(items, known)])
    lost: dict[int, str] = {}
    with closing(run_chunks(solve, left, plan)) as answers:
        for _, answer in answers:
            if isinstance(answer, LostChunk):
                gone = np.asarray(answer.items)
                lost |= dict.fromkeys(gone.tolist(), answer.reason)
                answer = blank_samples(gone)
            else:
                journal.append(f"{stage}/{answer['item'][0]}", {"samples": answer})
            parts.append(answer)
            told(len(answer))
    rows = np.concatenate([np.zeros(0, dtype=SAMPLE_DTYPE), *parts])
    return rows[np.argsort(rows["item"], kind="stable")], lost


def _decoded(arrays: Mapping[str, NDArray[Any]], journal: Journal) -> Rows:
    rows = arrays.get("samples")
    if rows is None or rows.dtype != SAMPLE_DTYPE or rows.ndim != 1:
        raise _unfit(journal, "holds other columns than this version writes")
    if not np.isin(rows["verdict"], list(Verdict)).all():
        raise _unfit(journal, "holds a verdict without a meaning")
    return rows


def _unfit(journal: Journal, told: str) -> InputRefused:
    return InputRefused(told, where=str(journal.path), fix="start over with --force")

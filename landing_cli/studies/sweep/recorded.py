"""Facets of all cells solved in chunks, each recorded as it comes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.reach.facet_work import in_chunks, solve_items
from landing_cli.reach.free_descent import PreparedCase
from landing_cli.results.journal import Journal
from landing_cli.studies.sweep.records import CELL_COLUMNS, ITEM_DTYPE, Values, blank_columns, reduced

Items = NDArray[np.int64]


def solve_reduced(prepared: tuple[PreparedCase, ...], facets: int, items: Items) -> NDArray[np.void]:
    """Solve a chunk of items and keep what the sweep stores of them.

    Parameters
    ----------
    prepared : tuple of PreparedCase
        Every case.
    facets : int
        Facets of the mesh.
    items : (k,) int
        Case times facets plus facet, each.

    Returns
    -------
    (k,) structured array of ITEM_DTYPE
    """
    return reduced(solve_items(prepared, facets, items))


def solve_all(
    journal: Journal,
    count: int,
    solve: Callable[[Items], NDArray[np.void]],
    plan: WorkPlan,
    told: Callable[[int], None],
) -> tuple[dict[str, Values], dict[int, str]]:
    """Solve every item, but take over those that the journal holds.

    Parameters
    ----------
    journal : Journal
        Open; every chunk is recorded in it before the next is awaited.
    count : int
        Items are 0 to count - 1.
    solve : callable
        Solves some items, picklable; an answer depends on nothing but the item.
    plan : WorkPlan
        Where to solve.
    told : callable
        Told the number of items that became known.

    Returns
    -------
    dict of (count,) arrays
        ``CELL_COLUMNS`` of every item; unresolved where one was lost.
    dict of int to str
        The lost items and why.

    Raises
    ------
    InputRefused
        If the journal holds what this run cannot have recorded.
    """
    columns, known = blank_columns(count), np.zeros(count, dtype=np.bool_)
    for arrays in journal.records.values():
        rows = _sound(arrays.get("rows"), known, str(journal.path))
        _put(columns, rows)
        known[rows["item"]] = True
    told(int(known.sum()))
    lost: dict[int, str] = {}
    left = [chunk[~known[chunk]] for chunk in in_chunks(np.arange(count))]
    with closing(run_chunks(solve, [chunk for chunk in left if len(chunk)], plan)) as answers:
        for _, answer in answers:
            if isinstance(answer, LostChunk):
                items = np.asarray(answer.items)
                lost |= dict.fromkeys(items.tolist(), answer.reason)
                told(len(items))
                continue
            journal.append(f"items/{answer['item'][0]}", {"rows": answer})
            _put(columns, answer)
            told(len(answer))
    return columns, lost


def _put(columns: dict[str, Values], rows: NDArray[np.void]) -> None:
    for column in CELL_COLUMNS:
        columns[column.name][rows["item"]] = rows[column.name]


def _sound(rows: NDArray[np.void] | None, known: NDArray[np.bool_], path: str) -> NDArray[np.void]:
    """A record's rows, if this run can have recorded them."""
    refused = InputRefused(
        "holds facets that this run never asks for, or one of them twice",
        where=path,
        fix="start over with --force",
    )
    if rows is None or rows.dtype != ITEM_DTYPE or rows.ndim != 1:
        raise refused
    items = rows["item"]
    if (items < 0).any() or (items >= len(known)).any() or known[items].any():
        raise refused
    if len(np.unique(items)) != len(items):
        raise refused
    return rows

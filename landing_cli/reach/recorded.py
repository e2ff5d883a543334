"""Facets solved in chunks, each recorded as it comes, so that a kill loses only those in flight."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.reach.records import FacetSolutions, blank_rows, join, take_rows
from landing_cli.reach.stored import solutions_from_arrays, solutions_to_arrays
from landing_cli.results.journal import Journal

Facets = NDArray[np.int64]


def solve_recorded(
    journal: Journal,
    stage: str,
    chunks: Sequence[Facets],
    solve: Callable[[Facets], FacetSolutions],
    plan: WorkPlan,
    progress: Callable[[int], None] | None = None,
    *,
    part_of_stage: bool = False,
) -> tuple[FacetSolutions, dict[int, str]]:
    """Solve facets in chunks, but take over those that the journal holds.

    Parameters
    ----------
    journal : Journal
        Open; every chunk is recorded in it before the next is awaited.
    stage : str
        Names this part of the run in the journal: the case, and the round where there are several.
    chunks : sequence of (k,) int
        The facets to solve, each once.
    solve : callable
        Solves some facets, picklable; a facet's answer depends on nothing but the facet.
    plan : WorkPlan
        Where to solve.
    progress : callable, optional
        Told the number of facets that became known.
    part_of_stage : bool
        Whether the stage asks several times, so that its journal may hold more than these facets: where a
        lost one is solved at last, later questions can be others than before.

    Returns
    -------
    FacetSolutions
        Of all facets, ascending; blank where a facet was lost.
    dict of int to str
        The lost facets and why. They are not recorded, so that the next run tries them again.

    Raises
    ------
    InputRefused
        If the journal holds what this run cannot have recorded.
    """
    tell = progress or (lambda facets: None)
    parts = [solutions_from_arrays(a) for key, a in journal.records.items() if key.startswith(f"{stage}/")]
    if part_of_stage:
        wanted = np.concatenate([np.zeros(0, np.int64), *chunks])
        parts = [take_rows(part, np.flatnonzero(np.isin(part.rows["facet"], wanted))) for part in parts]
    known = np.concatenate([part.rows["facet"] for part in parts]) if parts else np.zeros(0, np.int64)
    asked = np.concatenate(chunks) if len(chunks) else known
    if len(np.unique(known)) != len(known) or not np.isin(known, asked).all():
        told = "holds facets that this run never asks for, or one of them twice"
        raise InputRefused(told, where=str(journal.path), fix="start over with --force")
    tell(len(known))
    left = [chunk[~np.isin(chunk, known)] for chunk in chunks]
    lost: dict[int, str] = {}
    with closing(run_chunks(solve, [chunk for chunk in left if len(chunk)], plan)) as answers:
        for _, answer in answers:
            if isinstance(answer, LostChunk):
                facets = np.asarray(answer.items)
                lost |= dict.fromkeys(facets.tolist(), answer.reason)
                answer = FacetSolutions(blank_rows(facets), np.zeros((0, 3)))
            else:
                journal.append(f"{stage}/{answer.rows['facet'][0]}", solutions_to_arrays(answer))
            parts.append(answer)
            tell(len(answer.rows))
    return join(parts), lost

"""What would make facets of stored cases reachable: one facet, or all of them as a table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial

import numpy as np
from numpy.typing import NDArray

from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.reach.flown import asked_row
from landing_cli.reach.kernels import are_compiled
from landing_cli.reach.records import Binding, Verdict
from landing_cli.reach.relaxations import Kind
from landing_cli.reach.stored import CaseResult
from landing_cli.reach.why_not import Searched, WhyNot, why_not
from landing_cli.results.tables import Table, TableColumn

Floats = NDArray[np.float64]

CHUNK_FACETS = 64
# Columns of the least changes, and of how far they were looked for.
CHANGES = {
    Kind.THRUST: "more_thrust_n",
    Kind.TIME: "more_time_s",
    Kind.GLIDE_SLOPE: "wider_glide_slope_deg",
    Kind.ELLIPSOID: "smaller_ellipsoid_m",
    Kind.PROPELLANT: "more_propellant_kg",
    Kind.TERRAIN: "depth_in_rock_m",
}
SEARCHED = {
    Kind.THRUST: "searched_more_thrust_n",
    Kind.TIME: "searched_more_time_s",
    Kind.GLIDE_SLOPE: "searched_wider_glide_slope_deg",
    Kind.ELLIPSOID: "searched_smaller_ellipsoid_m",
    Kind.PROPELLANT: "searched_more_propellant_kg",
}
SEARCHED_LESS_TIME = "searched_less_time_s"


def why_not_facet(result: CaseResult, facet: int, say: Callable[[str], None]) -> WhyNot | None:
    """Find what would make one facet reachable.

    Parameters
    ----------
    result : CaseResult
        The case.
    facet : int
        0-based.
    say : callable
        Told one line where kernels compile first.

    Returns
    -------
    WhyNot or None
        None where it is reachable, or was lost.

    Raises
    ------
    InputRefused
        If there is no such facet, or the run did not ask for it.
    """
    row = asked_row(result, facet)
    rows = result.solutions.rows[row : row + 1]
    if rows["verdict"][0] == Verdict.REACHABLE or facet in result.lost:
        return None
    if not are_compiled(result.case.descent):
        from landing_cli.reach.pipeline import COMPILING

        say(COMPILING)
    return why_not(result.case, rows)


def why_not_tables(
    cases: Sequence[CaseResult], plan: WorkPlan, progress: Callable[[int, int], None]
) -> dict[str, Table]:
    """Find what would make every facet reachable that is not, case by case.

    Parameters
    ----------
    cases : sequence of CaseResult
        Of one run.
    plan : WorkPlan
        Where to search.
    progress : callable
        Told (searched, total) facets.

    Returns
    -------
    dict of Table
        A table a case by its name, a row a facet; lost facets are left out.
    """
    open_ = [_not_reachable(result) for result in cases]
    total, done = sum(map(len, open_)), 0
    tables = {}
    for result, rows in zip(cases, open_, strict=True):
        chunks = [rows[i : i + CHUNK_FACETS] for i in range(0, len(rows), CHUNK_FACETS)]
        answers: dict[int, WhyNot] = {}
        with closing(run_chunks(partial(why_not, result.case), chunks, plan)) as coming:
            for index, answer in coming:
                assert not isinstance(answer, LostChunk)  # threads lose nothing
                answers[index] = answer
                done += len(answer.facets)
                progress(done, total)
        tables[result.case.name] = _table(rows, [answers[index] for index in range(len(chunks))])
    return tables


def _not_reachable(result: CaseResult) -> NDArray[np.void]:
    rows = result.solutions.rows
    lost = np.isin(rows["facet"], np.array(sorted(result.lost), dtype=np.int64))
    return rows[(rows["verdict"] != Verdict.REACHABLE) & ~lost]


def _table(rows: NDArray[np.void], parts: Sequence[WhyNot]) -> Table:
    """Lay the answers out; what a case does not limit has no numbers."""
    columns = {
        "facet": TableColumn(rows["facet"]),
        "verdict": TableColumn(rows["verdict"], _words(Verdict)),
        "proved": TableColumn(rows["proved"]),
        "binding": TableColumn(rows["binding"], _words(Binding)),
        "easiest": TableColumn(np.array([word for part in parts for word in _easiest(part)], dtype=str)),
    }
    searched = {item.kind: item for part in parts[:1] for item in part.searched}
    for kind, name in CHANGES.items():
        columns[name] = TableColumn(_column(parts, kind, len(rows)))
    for kind, name in SEARCHED.items():
        columns[name] = TableColumn(np.full(len(rows), _highest(searched.get(kind))))
    shortest = -searched[Kind.TIME].lowest if Kind.TIME in searched else np.nan
    columns[SEARCHED_LESS_TIME] = TableColumn(np.full(len(rows), shortest))
    return Table(columns)


def _column(parts: Sequence[WhyNot], kind: Kind, size: int) -> Floats:
    found = [
        part.changes[:, k] for part in parts for k, item in enumerate(part.searched) if item.kind is kind
    ]
    return np.concatenate(found) if found else np.full(size, np.nan)


def _easiest(part: WhyNot) -> list[str]:
    words = [item.kind.value for item in part.searched]
    return [words[k] if k >= 0 else "nothing" for k in part.easiest()]


def _highest(searched: Searched | None) -> float:
    return np.nan if searched is None else searched.highest


def _words(flags: type[Verdict] | type[Binding]) -> dict[int, str]:
    return {int(flag): flag.name.lower() for flag in flags}

"""For which cells of a sweep a facet is reachable."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from landing_cli.errors import InputRefused
from landing_cli.reach.records import Verdict
from landing_cli.studies.sweep.records import CellResult

Value = float | str


@dataclass(frozen=True)
class FacetLine:
    """What a facet is along the first axis, for one initial state and one choice on the other axes.

    Attributes
    ----------
    initial_state : str
    at : tuple of (str, value)
        The other axes and their values.
    values : tuple of float or str
        Along the first axis.
    reachable : tuple of bool
        At each of them.
    """

    initial_state: str
    at: tuple[tuple[str, Value], ...]
    values: tuple[Value, ...]
    reachable: tuple[bool, ...]

    @property
    def told(self) -> str:
        """Where it is reachable, as ``650, 800 to 1200``; a dash where it is not."""
        found = zip(self.values, self.reachable, strict=True)
        runs = [[value for value, _ in run] for good, run in groupby(found, lambda one: one[1]) if good]
        return ", ".join(map(_span, runs)) or "-"


def facet_lines(cases: Sequence[CellResult], facet: int) -> Iterator[FacetLine]:
    """Follow a facet along the first axis.

    Parameters
    ----------
    cases : sequence of CellResult
        Of one sweep.
    facet : int
        0-based.

    Yields
    ------
    FacetLine
        One for each initial state and each choice on the other axes among the cases.

    Raises
    ------
    InputRefused
        If there is no such facet.
    """
    check_facet(cases, facet)
    first = cases[0].grid.question.axes[0].name
    lines: dict[tuple[int, tuple[tuple[str, Value], ...]], list[CellResult]] = {}
    for case in sorted(cases, key=lambda case: (case.state, case.cell)):
        others = tuple((name, value) for name, value in case.at.items() if name != first)
        lines.setdefault((case.state, others), []).append(case)
    for (_, others), along in lines.items():
        verdicts = (bool(case.columns["verdict"][facet] == Verdict.REACHABLE) for case in along)
        values = tuple(case.at[first] for case in along)
        yield FacetLine(along[0].initial_state, others, values, tuple(verdicts))


def check_facet(cases: Sequence[CellResult], facet: int) -> None:
    """Refuse a facet that does not exist."""
    count = cases[0].grid.facets
    if not 0 <= facet < count:
        raise InputRefused("no such facet", where=f"--facet {facet}", fix=f"take one of 0 to {count - 1}")


def _span(values: Sequence[Value]) -> str:
    ends = [f"{value:.12g}" if isinstance(value, float) else value for value in (values[0], values[-1])]
    if len(values) == 1:
        return ends[0]
    return " to ".join(ends) if isinstance(values[0], float) else ", ".join(map(str, values))

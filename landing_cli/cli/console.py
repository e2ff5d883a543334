"""The only place that prints: data to stdout, everything else to stderr."""

from __future__ import annotations

import json
import math
import sys
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any

from landing_cli.cli.guard import tell

PLAIN_LINE_EVERY_S = 5.0
RATE_WINDOW_S = 30.0


def print_table(columns: Sequence[str], rows: Sequence[Sequence[object]], title: str = "") -> None:
    """Print a table to stdout: ruled on a terminal, aligned plain text elsewhere.

    Parameters
    ----------
    columns : sequence of str
        Headings.
    rows : sequence of sequences
        Cells; numbers are shown with five significant digits, None and NaN as ``-``.
    title : str
        Shown on a terminal only.
    """
    cells = [[_cell(value) for value in row] for row in rows]
    numeric = [all(_is_number(row[i]) or _cell(row[i]) == "-" for row in rows) for i in range(len(columns))]
    if sys.stdout.isatty():
        _print_ruled(columns, cells, numeric, title)
        return
    widths = [max(len(line[i]) for line in [list(columns), *cells]) for i in range(len(columns))]
    for line in [list(columns), *cells]:
        padded = [
            text.rjust(width) if number else text.ljust(width)
            for text, width, number in zip(line, widths, numeric, strict=True)
        ]
        print_text("  ".join(padded).rstrip())


def print_json(value: Any) -> None:
    """Print one JSON value to stdout; NaN and infinities become null.

    Parameters
    ----------
    value : dict, list or scalar
        Numpy scalars and arrays are accepted.
    """
    print_text(json.dumps(_jsonable(value), indent=2, allow_nan=False, ensure_ascii=False))


def print_reports_json(reports: Sequence[Any], path: Path) -> None:
    """Print what a verification found as JSON, with every check.

    Parameters
    ----------
    reports : sequence of dataclasses
        One a case; each tells whether it is ``verified``.
    path : Path
        The run's file.
    """
    cases = [{**asdict(report), "verified": report.verified} for report in reports]
    verified = all(report.verified for report in reports)
    print_json({"run": str(path), "verified": verified, "cases": cases})


def print_text(text: str) -> None:
    """Print text to stdout.

    Parameters
    ----------
    text : str
        A line end is added unless there is one.
    """
    sys.stdout.write(text if text.endswith("\n") else f"{text}\n")


class Console:
    """What a command says on stderr, unless it was asked to be quiet.

    Parameters
    ----------
    quiet : bool
        Say nothing but warnings.
    """

    def __init__(self, quiet: bool = False) -> None:
        self.quiet = quiet

    def say(self, message: str) -> None:
        """Tell something worth knowing.

        Parameters
        ----------
        message : str
            One line.
        """
        if not self.quiet:
            tell(message)

    def warn(self, message: str) -> None:
        """Tell something that the user should act on; ``--quiet`` does not silence it.

        Parameters
        ----------
        message : str
            One line.
        """
        tell(f"warning: {message}")

    def progress(self, unit: str) -> Progress:
        """Follow a long computation.

        Parameters
        ----------
        unit : str
            What is counted, in the plural.

        Returns
        -------
        Progress
        """
        return Progress(unit, self.quiet)


class Progress:
    """Progress on stderr, called with (done, total): a bar on a terminal, a line now and then elsewhere.

    Parameters
    ----------
    unit : str
        What is counted, in the plural.
    quiet : bool
        Show nothing.
    """

    def __init__(self, unit: str, quiet: bool = False) -> None:
        self._unit = unit
        self._quiet = quiet
        self._began = time.monotonic()
        self._begun_at: int | None = None
        self._recent: deque[tuple[float, int]] = deque()
        self._last_line = self._began
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, done: int, total: int) -> None:
        """Show how far it is.

        Parameters
        ----------
        done, total : int
            What is finished, resumed work included, and what there is.
        """
        if self._quiet:
            return
        if self._begun_at is None:
            self._begun_at = done
        if sys.stderr.isatty():
            self._draw(done, total)
        else:
            self._write_line(done, total)

    def _write_line(self, done: int, total: int) -> None:
        now = time.monotonic()
        rate = self._rate(now, done)
        if now - self._last_line < PLAIN_LINE_EVERY_S and done < total:
            return
        if done >= total and now - self._last_line < 1.0:
            return  # it took no time: nothing to follow
        self._last_line = now
        speed = f", {rate:.4g} a second" if rate > 0 else ""
        left = f", {_duration((total - done) / rate)} left" if rate > 0 and done < total else ""
        tell(f"{done}/{total} {self._unit}{speed}{left}")

    def _rate(self, now: float, done: int) -> float:
        """Units a second of late; 0 while nothing is known about it.

        What a resumed run finds done says nothing about its speed, and neither does the time up to the first
        answer, which compilation may have taken.
        """
        if done == self._begun_at:
            return 0.0
        self._recent.append((now, done))
        while len(self._recent) > 2 and now - self._recent[1][0] >= RATE_WINDOW_S:
            self._recent.popleft()
        since, before = self._recent[0]
        return (done - before) / (now - since) if now > since else 0.0

    def _draw(self, done: int, total: int) -> None:
        if self._bar is None:
            self._bar = _new_bar(self._unit)
            self._task = self._bar.add_task(self._unit, total=total)
            self._bar.start()
        self._bar.update(self._task, completed=done, total=total)


def _new_bar(unit: str) -> Any:
    from rich.console import Console as RichConsole
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress as RichProgress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        """Units a second."""

        def render(self, task: Task) -> Text:
            return Text(f"{task.speed or 0:.4g}/s")

    return RichProgress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=RichConsole(file=sys.stderr),
        transient=True,
    )


def _print_ruled(
    columns: Sequence[str], cells: Sequence[Sequence[str]], numeric: Sequence[bool], title: str
) -> None:
    from rich import box
    from rich.console import Console as RichConsole
    from rich.table import Table
    from rich.text import Text

    table = Table(title=title or None, box=box.SIMPLE_HEAD, title_justify="left")
    for name, number in zip(columns, numeric, strict=True):
        table.add_column(Text(name), justify="right" if number else "left")
    for row in cells:
        table.add_row(*map(Text, row))
    RichConsole(file=sys.stdout).print(table)


def _cell(value: object) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _jsonable(value: Any) -> Any:
    if hasattr(value, "tolist"):  # a numpy scalar or array
        value = value.tolist()
    if isinstance(value, dict):
        return {str(key): _jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_jsonable(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


def print_told(
    told: Mapping[str, str],
    known: Sequence[Mapping[str, Any]],
    rows: Sequence[Sequence[Any]],
    facet: int,
    path: Path,
    as_json: bool,
) -> None:
    """Print what is known about one facet: a sentence a case and a table, or JSON.

    Parameters
    ----------
    told : mapping of str to str
        The sentence of each case.
    known : sequence of mapping
        What JSON tells of each case.
    rows : sequence of sequences
        Of the table: a quantity, and its value in each case.
    facet : int
        0-based.
    path : Path
        The result's file.
    as_json : bool
        Print JSON.
    """
    if as_json:
        cases = [
            {"case": name, "told": sentence, **values}
            for (name, sentence), values in zip(told.items(), known, strict=True)
        ]
        print_json({"run": str(path), "facet": facet, "cases": cases})
        return
    for name, sentence in told.items():
        print_text(f"{name}: {sentence}")
    print_table(["quantity", *told], rows)

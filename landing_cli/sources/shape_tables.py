"""The PDS tables of shape models: vertices then plates, with or without counts and row numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain, islice
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.sources.shape_lines import Row, ShapeLines, Tokens, batches
from landing_cli.sources.shape_records import FACET_CAP, Table, add_records
from landing_cli.sources.shape_tokens import indices, reals

Number = TypeVar("Number", np.float64, np.int64)


def add_table(lines: ShapeLines, table: Table, stream: Iterator[Row]) -> str:
    """Read a table in any of its dialects.

    Parameters
    ----------
    lines : ShapeLines
        The file, for messages.
    table : Table
        Receives the rows.
    stream : iterator of (int, list of bytes)
        Line number and tokens of each row.

    Returns
    -------
    str
        Name of the dialect.

    Notes
    -----
    An optional first row counts the vertices, or the vertices and the plates. Then come v and f records,
    or rows of three numbers (four, where a running number leads): the vertices, optionally the count of
    the plates, the plates. Without counts the plates begin at the first row without a decimal point.
    """
    head = next(stream, None)
    if head is None:
        raise InputRefused("holds no data", where=str(lines.path))
    counts = _counts(head, lines)
    first = next(stream, None) if counts else head
    stream = chain([first] if first else [], stream)
    if first and first[1][0][:1].isalpha():
        dialect = "v/f records"
        add_records(lines, table, stream)
    else:
        dialect = "plain table"
        counts += _add_vertices_then_plates(lines, table, stream, counts)
    _hold_to(counts, table, lines)
    return f"{dialect} with counts" if counts else dialect


def _counts(row: Row, lines: ShapeLines) -> list[int]:
    """Return the counts that a row declares, or nothing where it is no row of counts."""
    number, tokens = row
    if len(tokens) > 2 or tokens[0][:1].isalpha():
        return []
    found = indices([tokens], [number], lines)[0].tolist()
    if min(found) < 4 or max(found) > FACET_CAP:
        raise InputRefused(f"declares {found} rows; 4 to {FACET_CAP} are read", where=lines.where(number))
    return found


def _add_vertices_then_plates(
    lines: ShapeLines, table: Table, stream: Iterator[Row], counts: list[int]
) -> list[int]:
    """Read both parts; return the count of plates where a row of its own declares it."""
    later: list[int] = []
    if counts:
        _add_part(lines, islice(stream, counts[0]), table.vertices, table.vertex_lines, reals)
        middle = next(stream, None)
        if middle and len(counts) == 1 and len(middle[1]) == 1:
            later = _counts(middle, lines)
        elif middle:
            stream = chain([middle], stream)
    else:
        first_plate: list[Row] = []
        _add_part(lines, _vertices(stream, first_plate), table.vertices, table.vertex_lines, reals)
        stream = chain(first_plate, stream)
    _add_part(lines, stream, table.faces, table.facet_lines, indices)
    return later


def _vertices(stream: Iterator[Row], first_plate: list[Row]) -> Iterator[Row]:
    """Pass rows on until one has no decimal point; that one is put aside."""
    for row in stream:
        if not any(b"." in token or b"e" in token or b"E" in token for token in row[1]):
            first_plate.append(row)
            return
        yield row


def _add_part(
    lines: ShapeLines,
    stream: Iterator[Row],
    arrays: list[NDArray[Number]],
    line_numbers: list[int],
    convert: Callable[[list[Tokens], list[int], ShapeLines], NDArray[Number]],
) -> None:
    """Convert one part of a plain table, whose rows all have three numbers, or all four."""
    width, done = 0, 0
    for batch in batches(stream):
        numbers = [number for number, _ in batch]
        rows = [tokens for _, tokens in batch]
        width = width or len(rows[0])
        for number, row in batch:
            if len(row) != width or width not in (3, 4):
                wanted = width if width in (3, 4) else 3
                raise InputRefused(
                    f"a row of {len(row)} numbers where {wanted} are expected", where=lines.where(number)
                )
        values = convert(rows, numbers, lines)
        if width == 4:
            values = _without_running_number(values, numbers, lines, done)
        arrays.append(values)
        line_numbers.extend(numbers)
        done += len(rows)
        if done > FACET_CAP:
            raise InputRefused(f"holds more than {FACET_CAP} rows", where=str(lines.path))


def _without_running_number(
    values: NDArray[Number], numbers: list[int], lines: ShapeLines, done: int
) -> NDArray[Number]:
    counted = values[:, 0] - np.arange(done, done + len(values))
    wrong = np.flatnonzero((counted != counted[0]) | ((counted != 0) & (counted != 1)))
    if len(wrong):
        raise InputRefused(
            f"the first of four numbers is {values[wrong[0], 0]:g}, not the running number of the row",
            where=lines.where(numbers[wrong[0]]),
            fix="plates must be triangles, vertices have three coordinates",
        )
    return values[:, 1:]


def _hold_to(counts: list[int], table: Table, lines: ShapeLines) -> None:
    held = [len(table.vertex_lines), len(table.facet_lines)]
    for noun, declared, found in zip(("vertices", "facets"), counts, held, strict=False):
        if declared != found:
            raise InputRefused(
                f"declares {declared} {noun} and holds {found}",
                where=str(lines.path),
                fix="is the file complete?",
            )

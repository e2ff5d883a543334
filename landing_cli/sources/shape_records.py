"""OBJ files and the PDS tables of v/f records, which are OBJ without the trimmings."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from landing_cli.body.mesh import FloatArray, IntArray
from landing_cli.errors import InputRefused
from landing_cli.sources.shape_lines import Row, ShapeLines, Tokens, batches
from landing_cli.sources.shape_tokens import indices, reals, shown

FACET_CAP = 4_000_000

# Appearance and grouping; mtllib names another file, which is never opened.
_IGNORED = frozenset([b"vn", b"vt", b"vp", b"g", b"o", b"s", b"mtllib", b"usemtl"])
_CORNER = re.compile(rb"\d+(/\d*){0,2}")


@dataclass
class Table:
    """Rows gathered block by block.

    Attributes
    ----------
    vertices, faces : list of (k, 3) arrays
        As written: the file's length unit, and indices that count from its own base.
    vertex_lines, facet_lines : list of int
        Line of each row, from 1.
    """

    vertices: list[FloatArray] = field(default_factory=list)
    faces: list[IntArray] = field(default_factory=list)
    vertex_lines: list[int] = field(default_factory=list)
    facet_lines: list[int] = field(default_factory=list)

    def add(self, lines: ShapeLines, vertices: list[Tokens], faces: list[Tokens]) -> None:
        """Convert the rows of a block, whose line numbers were appended already."""
        if vertices:
            self.vertices.append(reals(vertices, self.vertex_lines[-len(vertices) :], lines))
        if faces:
            self.faces.append(indices(faces, self.facet_lines[-len(faces) :], lines))
        if max(len(self.vertex_lines), len(self.facet_lines)) > FACET_CAP:
            raise InputRefused(
                f"holds more than {FACET_CAP} vertices or facets",
                where=str(lines.path),
                fix="resample it to a coarser mesh with another tool first",
            )

    def arrays(self) -> tuple[FloatArray, IntArray]:
        """Join the blocks."""
        empty_real, empty_index = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
        return np.concatenate([empty_real, *self.vertices]), np.concatenate([empty_index, *self.faces])


def add_records(lines: ShapeLines, table: Table, stream: Iterator[Row]) -> None:
    """Read v and f records; everything else an OBJ file may hold is skipped or refused by name.

    Parameters
    ----------
    lines : ShapeLines
        The file, for messages.
    table : Table
        Receives the rows.
    stream : iterator of (int, list of bytes)
        Line number and tokens of each row.
    """
    for batch in batches(stream):
        _add_batch(lines, table, batch)


def _add_batch(lines: ShapeLines, table: Table, batch: list[Row]) -> None:
    vertices: list[Tokens] = []
    faces: list[Tokens] = []
    for number, row in batch:
        key = row[0]
        if key == b"v":
            # Behind the position: nothing, a weight, or a colour.
            if len(row) not in (4, 5, 7):
                raise InputRefused(f"a vertex of {len(row) - 1} numbers", where=lines.where(number))
            vertices.append(row[1:4])
            table.vertex_lines.append(number)
        elif key == b"f":
            if len(row) != 4:
                raise _no_triangle(len(row) - 1, lines.where(number))
            faces.append(row[1:])
            table.facet_lines.append(number)
        elif key not in _IGNORED:
            raise InputRefused(
                f"{shown(key)} begins no record of an OBJ file or a vertex-facet table",
                where=lines.where(number),
                fix="the formats that are read are OBJ (triangles) and the PDS vertex/facet tables",
            )
    if any(b"/" in corner for row in faces for corner in row):
        faces = [[_position(corner) for corner in row] for row in faces]
    table.add(lines, vertices, faces)


def _no_triangle(corners: int, where: str) -> InputRefused:
    if corners < 3:
        return InputRefused(f"a facet of {corners} corners", where=where, fix="is the file cut short?")
    noun = "a quadrilateral" if corners == 4 else f"a facet of {corners} corners"
    return InputRefused(f"is {noun}; only triangles are read", where=where, fix="triangulate the mesh first")


def _position(corner: bytes) -> bytes:
    """Keep the vertex of a corner v/vt/vn; whatever else is written there reaches the strict check."""
    return corner.split(b"/", 1)[0] if _CORNER.fullmatch(corner) else corner

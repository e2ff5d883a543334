"""Shape models from files and into files: OBJ and the PDS vertex/facet tables, checked before use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from landing_cli.body.mesh import FloatArray, IntArray, Mesh
from landing_cli.body.mesh_checks import Surface, check_surface, checked_mesh
from landing_cli.errors import InputRefused, OutputRefused
from landing_cli.sources.shape_lines import ShapeLines
from landing_cli.sources.shape_records import Table, add_records
from landing_cli.sources.shape_tables import add_table
from landing_cli.sources.whole_file import write_whole

LengthUnit = Literal["km", "m"]
METRES: dict[str, float] = {"km": 1000.0, "m": 1.0}


@dataclass(frozen=True, eq=False)
class RawShape:
    """A shape file as it is written, before any check of its surface.

    Attributes
    ----------
    path : Path
    sha256 : str
        Of the bytes that were read.
    dialect : str
        Which of the formats it is.
    vertices : (n, 3) float
        In the file's own length unit.
    faces : (m, 3) int
        Counting from the file's own base.
    vertex_lines, facet_lines : (n,) and (m,) int
        Lines of the file, from 1.
    """

    path: Path
    sha256: str
    dialect: str
    vertices: FloatArray
    faces: IntArray
    vertex_lines: IntArray
    facet_lines: IntArray

    def surface(self, length_unit: LengthUnit, index_base: int) -> Surface:
        """State the unit and the base, and get triangles in m with 0-based corners."""
        return Surface(
            self.vertices * METRES[length_unit],
            self.faces - index_base,
            self.vertex_lines,
            self.facet_lines,
        )


@dataclass(frozen=True, eq=False)
class ShapeFile:
    """A checked mesh and where it came from.

    Attributes
    ----------
    mesh : Mesh
        In m, about the file's origin.
    path : Path
    sha256 : str
        Of the file.
    dialect : str
        Which of the formats it is.
    length_unit : {"km", "m"}
        Unit of the file, as stated by the user.
    index_base : int
        0 or 1: what the facets count from.
    """

    mesh: Mesh
    path: Path
    sha256: str
    dialect: str
    length_unit: LengthUnit
    index_base: int


def read_raw(path: Path | str) -> RawShape:
    """Read a file strictly, without asking whether its triangles make a body.

    Parameters
    ----------
    path : Path or str
        ``.obj`` is read as OBJ, anything else as a PDS vertex/facet table. No other file is opened,
        whatever this one names.

    Returns
    -------
    RawShape

    Raises
    ------
    InputRefused
        If it is no regular file, too large, or no file of these formats; the line is named.
    """
    lines = ShapeLines(Path(path))
    table = Table()
    stream = lines.rows()
    if lines.path.suffix.lower() == ".obj":
        dialect = "OBJ"
        add_records(lines, table, stream)
    else:
        dialect = add_table(lines, table, stream)
    vertices, faces = table.arrays()
    return RawShape(
        lines.path,
        lines.sha256,
        dialect,
        vertices,
        faces,
        np.array(table.vertex_lines, dtype=np.int64),
        np.array(table.facet_lines, dtype=np.int64),
    )


def index_base_of(raw: RawShape, length_unit: LengthUnit) -> int:
    """Decide whether the facets count from 0 or from 1.

    Parameters
    ----------
    raw : RawShape
        OBJ counts from 1 by its definition; a table may do either.
    length_unit : {"km", "m"}
        Unit of the file.

    Returns
    -------
    int
        The base under which all indices are in range; where both are possible, the one under which
        the surface passes its checks; 1 where neither is.

    Raises
    ------
    InputRefused
        If an OBJ file has an index 0.
    """
    if not len(raw.faces):
        return 1
    if raw.dialect == "OBJ":
        zero = np.flatnonzero((raw.faces == 0).any(axis=1))
        if len(zero):
            raise InputRefused(
                "vertex index 0: OBJ counts from 1",
                where=f"{raw.path}, line {raw.facet_lines[zero[0]]}",
                fix="if the whole file counts from 0, say so (--index-base 0)",
            )
        return 1
    low, high = int(raw.faces.min()), int(raw.faces.max())
    possible = [base for base in (1, 0) if low >= base and high < len(raw.vertices) + base]
    for base in possible[: len(possible) if len(possible) > 1 else 0]:
        if all(result.fault is None for result in check_surface(raw.surface(length_unit, base))):
            return base
    return possible[0] if possible else 1


def read_shape(path: Path | str, length_unit: LengthUnit, index_base: int | None = None) -> ShapeFile:
    """Read a shape model and check it.

    Parameters
    ----------
    path : Path or str
        OBJ file or PDS vertex/facet table.
    length_unit : {"km", "m"}
        Unit of the coordinates in the file.
    index_base : int, optional
        0 or 1, what the facets count from; decided by the checks where it is not stated.

    Returns
    -------
    ShapeFile

    Raises
    ------
    InputRefused
        If the file cannot be read or is not the surface of one body; the line, facet, edge or vertex is
        named.
    """
    raw = read_raw(path)
    base = index_base_of(raw, length_unit) if index_base is None else index_base
    mesh = checked_mesh(raw.surface(length_unit, base), source=str(path))
    return ShapeFile(mesh, raw.path, raw.sha256, raw.dialect, length_unit, base)


def read_mesh(path: Path | str, length_unit: LengthUnit) -> Mesh:
    """Read a shape model, checked, in m about the file's origin (see :func:`read_shape`).

    Parameters
    ----------
    path : Path or str
        OBJ file or PDS vertex/facet table.
    length_unit : {"km", "m"}
        Unit of the coordinates in the file.

    Returns
    -------
    Mesh
    """
    return read_shape(path, length_unit).mesh


def rounded(mesh: Mesh) -> Mesh:
    """Round the coordinates to the millimetre that :func:`write_obj` keeps."""
    return Mesh(np.round(mesh.vertices, 3) + 0.0, mesh.faces)


def obj_text(mesh: Mesh, header_lines: Sequence[str], length_unit: LengthUnit) -> str:
    """Write a mesh as OBJ, to the millimetre.

    Parameters
    ----------
    mesh : Mesh
        In m.
    header_lines : sequence of str
        Comments at the top.
    length_unit : {"km", "m"}
        Unit of the coordinates in the text.

    Returns
    -------
    str
    """
    decimals = 6 if length_unit == "km" else 3
    # Adding zero turns -0.0 into 0.0.
    values = np.round(rounded(mesh).vertices / METRES[length_unit], decimals) + 0.0
    comments = [f"# {line}".rstrip() for text in header_lines for line in text.splitlines()]
    vertices = [f"v {x:.{decimals}f} {y:.{decimals}f} {z:.{decimals}f}" for x, y, z in values.tolist()]
    facets = [f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist()]
    return "\n".join([*comments, *vertices, *facets, ""])


def write_obj(path: Path | str, mesh: Mesh, header_lines: Sequence[str], length_unit: LengthUnit) -> None:
    """Write a mesh into an OBJ file that appears whole or not at all.

    Parameters
    ----------
    path : Path or str
        File to create or replace.
    mesh : Mesh
        In m.
    header_lines : sequence of str
        Comments at the top: where the shape comes from.
    length_unit : {"km", "m"}
        Unit of the coordinates in the file.

    Raises
    ------
    OutputRefused
        If the file cannot be written.
    """
    path = Path(path)
    text = obj_text(mesh, header_lines, length_unit)
    try:
        write_whole(path, text.encode())
    except OSError as error:
        raise OutputRefused(
            f"cannot be written: {error.strerror or error}", where=str(path), fix="choose another output path"
        ) from error

"""Maps of per-facet values for viewers of meshes: PLY, VTP (ParaView) and OBJ; lengths in metres."""

from __future__ import annotations

import base64
import struct
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.mesh import Mesh
from landing_cli.results.tables import Table, TableColumn

COLOURS: Mapping[str, tuple[int, int, int]] = {
    "reachable": (0, 114, 178),
    "unreachable": (213, 94, 0),
    "unresolved": (153, 153, 153),
}
"""By verdict; told apart by colour-blind people too."""

_PLY_TYPES = {"f8": "double", "i4": "int", "u1": "uchar"}
_VTK_TYPES = {"f8": "Float64", "i8": "Int64", "i4": "Int32", "u1": "UInt8"}


def on_every_facet(table: Table, facets: int) -> Table:
    """Spread a table over all facets of a mesh.

    Parameters
    ----------
    table : Table
        With a column ``facet``; facets may be missing from it.
    facets : int
        Of the mesh.

    Returns
    -------
    Table
        One row a facet; NaN, or 0 in columns of integers, where the table has none.
    """
    rows = table.columns["facet"].values
    columns = {}
    for name, column in table.columns.items():
        if column.values.dtype.kind not in "iuf":
            continue
        values = np.full(facets, np.nan if column.values.dtype.kind == "f" else 0, dtype=column.values.dtype)
        values[rows] = column.values
        columns[name] = TableColumn(values, column.flags)
    columns["facet"] = TableColumn(np.arange(facets, dtype=np.int32))
    return Table(columns)


def to_ply(mesh: Mesh, table: Table) -> bytes:
    """Write a mesh with a colour and every column per facet as binary PLY.

    Parameters
    ----------
    mesh : Mesh
        The body.
    table : Table
        One row a facet (``on_every_facet``); a column ``verdict`` or ``probability`` gives the colours.

    Returns
    -------
    bytes
    """
    stored = {name: _narrowed(column.values) for name, column in table.columns.items()}
    fields: list[Any] = [("corners", "u1"), ("vertex_indices", "<i4", (3,)), ("colour", "u1", (3,))]
    fields += [(f"value_{name}", values.dtype.newbyteorder("<")) for name, values in stored.items()]
    faces = np.zeros(len(mesh.faces), dtype=fields)
    faces["corners"] = 3
    faces["vertex_indices"] = mesh.faces
    faces["colour"] = _colours(table)
    for name, values in stored.items():
        faces[f"value_{name}"] = values
    header = [
        "ply",
        "format binary_little_endian 1.0",
        "comment lengths in metres, body frame",
        f"element vertex {len(mesh.vertices)}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(mesh.faces)}",
        "property list uchar int vertex_indices",
        *(f"property uchar {colour}" for colour in ("red", "green", "blue")),
        *(f"property {_PLY_TYPES[values.dtype.str[1:]]} {name}" for name, values in stored.items()),
        "end_header",
    ]
    return "\n".join(header).encode() + b"\n" + mesh.vertices.astype("<f8").tobytes() + faces.tobytes()


def to_vtp(mesh: Mesh, table: Table) -> bytes:
    """Write a mesh with every column as cell data for ParaView (VTK XML PolyData).

    Parameters
    ----------
    mesh : Mesh
        The body.
    table : Table
        One row a facet (``on_every_facet``).

    Returns
    -------
    bytes
    """
    offsets = np.arange(3, 3 * len(mesh.faces) + 1, 3, dtype=np.int64)
    cells = [data_array(name, _narrowed(column.values)) for name, column in table.columns.items()]
    lines = [
        '<?xml version="1.0"?>',
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
        "<PolyData>",
        f'<Piece NumberOfPoints="{len(mesh.vertices)}" NumberOfPolys="{len(mesh.faces)}">',
        '<CellData Scalars="verdict">' if "verdict" in table.columns else "<CellData>",
        *cells,
        "</CellData>",
        f"<Points>{data_array('position_m', mesh.vertices)}</Points>",
        "<Polys>",
        data_array("connectivity", mesh.faces.reshape(-1)),
        data_array("offsets", offsets),
        "</Polys>",
        "</Piece>",
        "</PolyData>",
        "</VTKFile>",
    ]
    return "\n".join(lines).encode() + b"\n"


def to_obj(mesh: Mesh, table: Table) -> bytes:
    """Write a mesh as OBJ, its facets in order, in groups named after their verdict.

    Parameters
    ----------
    mesh : Mesh
        The body.
    table : Table
        One row a facet (``on_every_facet``); without a column ``verdict`` or ``probability`` there are no
        groups.

    Returns
    -------
    bytes
        OBJ holds no values per facet; take PLY or VTP for these.
    """
    lines = ["# lengths in metres, body frame; facets in the shape file's order"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    faces = [f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist()]
    words = _kinds(table)
    if words is None:
        return "\n".join([*lines, *faces, ""]).encode()
    starts = [0, *(i for i in range(1, len(faces)) if words[i] != words[i - 1]), len(faces)]
    for begin, end in pairwise(starts):
        lines += [f"g {words[begin]}", *faces[begin:end]]
    return "\n".join([*lines, ""]).encode()


WRITERS: Mapping[str, Callable[[Mesh, Table], bytes]] = {"ply": to_ply, "vtp": to_vtp, "obj": to_obj}


def _kinds(table: Table) -> list[str] | None:
    """What a facet's group is called: its verdict, or the tenth that its probability lies in."""
    verdict, probability = table.columns.get("verdict"), table.columns.get("probability")
    if verdict is not None:
        return verdict.cells()
    if probability is None:
        return None
    tenths = np.minimum((10.0 * probability.values).astype(int), 9)
    return [f"probability_{k / 10:.1f}_to_{(k + 1) / 10:.1f}" for k in tenths.tolist()]


def _colours(table: Table) -> NDArray[np.uint8]:
    grey = COLOURS["unresolved"]
    probability = table.columns.get("probability")
    if probability is not None:
        ends = np.array([COLOURS["unreachable"], COLOURS["reachable"]], dtype=np.float64)
        share = np.clip(probability.values, 0.0, 1.0)[:, None]
        return np.asarray(((1.0 - share) * ends[0] + share * ends[1]).round().astype(np.uint8))
    verdict = table.columns.get("verdict")
    words = verdict.cells() if verdict else ["unresolved"] * len(table)
    return np.array([COLOURS.get(word, grey) for word in words], dtype=np.uint8)


def _narrowed(values: NDArray[Any]) -> NDArray[Any]:
    """Bring values to one of the types that both formats know."""
    if values.dtype.kind == "f":
        return values.astype(np.float64)
    return values if values.dtype.str[1:] in _PLY_TYPES else values.astype(np.int32)


def data_array(name: str, values: NDArray[Any]) -> str:
    """Write an array as an element of a VTK file.

    Parameters
    ----------
    name : str
        Its name.
    values : (n,) or (n, k) array
        Of float64, int64, int32 or uint8.
    """
    raw = np.ascontiguousarray(values).astype(values.dtype.newbyteorder("<")).tobytes()
    packed = base64.b64encode(struct.pack("<Q", len(raw)) + raw).decode()
    components = values.shape[1] if values.ndim == 2 else 1
    kind = _VTK_TYPES[values.dtype.str[1:]]
    return (
        f'<DataArray type="{kind}" Name={quoteattr(name)} NumberOfComponents="{components}" format="binary">'
        f"{packed}</DataArray>"
    )

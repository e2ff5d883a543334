"""Lines in space for viewers: VTP (ParaView) and OBJ; lengths in metres."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from landing_cli.results.maps import data_array

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def lines_to_vtp(points_m: Floats, offsets: Ints) -> bytes:
    """Write lines for ParaView (VTK XML PolyData).

    Parameters
    ----------
    points_m : (n, 3) float, m
        Line after line.
    offsets : (k + 1,) int
        Where each begins and ends.

    Returns
    -------
    bytes
    """
    ends = np.ascontiguousarray(offsets[1:], dtype=np.int64)
    lines = [
        '<?xml version="1.0"?>',
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
        "<PolyData>",
        f'<Piece NumberOfPoints="{len(points_m)}" NumberOfLines="{len(ends)}">',
        f"<CellData>{data_array('line', np.arange(len(ends), dtype=np.int32))}</CellData>",
        f"<Points>{data_array('position_m', points_m)}</Points>",
        "<Lines>",
        data_array("connectivity", np.arange(len(points_m), dtype=np.int64)),
        data_array("offsets", ends),
        "</Lines>",
        "</Piece>",
        "</PolyData>",
        "</VTKFile>",
    ]
    return "\n".join(lines).encode() + b"\n"


def lines_to_obj(points_m: Floats, offsets: Ints) -> bytes:
    """Write lines as OBJ: points, and one element ``l`` a line.

    Parameters
    ----------
    points_m : (n, 3) float, m
        Line after line.
    offsets : (k + 1,) int
        Where each begins and ends.

    Returns
    -------
    bytes
    """
    text = ["# lengths in metres, body frame"]
    text += [f"v {x!r} {y!r} {z!r}" for x, y, z in points_m.tolist()]
    for begin, end in zip(offsets[:-1].tolist(), offsets[1:].tolist(), strict=True):
        text.append(f"l {' '.join(str(k + 1) for k in range(begin, end))}")
    return "\n".join([*text, ""]).encode()


LINE_WRITERS: Mapping[str, Callable[[Floats, Ints], bytes]] = {"vtp": lines_to_vtp, "obj": lines_to_obj}

"""The boundary of the domain as the lines where the least thrust level is 1, in the file and as a table."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.mesh import Mesh
from landing_cli.reach.level_set import LevelSet, level_set
from landing_cli.results.tree import Dataset, Group


def margin_lines(mesh: Mesh, rows: NDArray[np.void]) -> LevelSet:
    """Trace the boundary over a surface whose every facet has a row.

    Parameters
    ----------
    mesh : Mesh
        The surface.
    rows : (m,) structured array of FACET_DTYPE
        With the margin.

    Returns
    -------
    LevelSet
        Of tau = 1: the domain, as far as thrust, ellipsoid and glide slope decide it, lies to its left.
    """
    return level_set(mesh, 1.0 - rows["thrust_margin"], 1.0)


def lines_group(lines: LevelSet) -> Group:
    """Lay lines out for the store.

    Parameters
    ----------
    lines : LevelSet
        On the surface.
    """
    where = "line i owns points_m[offsets[i]:offsets[i + 1]]; a closed line ends where it begins"
    told = "points of the lines where tau is 1, body frame; lower tau to the left, seen from outside"
    return Group(
        {
            "points_m": Dataset(lines.points_m, "m", told, ("point", "xyz")),
            "offsets": Dataset(lines.offsets, "1", where, ("offset",)),
        },
        {"level": lines.level, "length_m": lines.length_m, "area_within_m2": lines.area_within_m2},
    )


def lines_from_group(group: Group) -> LevelSet:
    """Read what :func:`lines_group` laid out.

    Parameters
    ----------
    group : Group
        As it was stored.

    Raises
    ------
    ValueError
        If it is no list of lines.
    """
    points, offsets = group.dataset("points_m").data, group.dataset("offsets").data
    level, area = group.attributes["level"], group.attributes["area_within_m2"]
    if (
        points.dtype != np.float64
        or points.ndim != 2
        or points.shape[1] != 3
        or not np.isfinite(points).all()
    ):
        raise ValueError("level_set/points_m is no list of points")
    if offsets.dtype.kind != "i" or offsets.ndim != 1 or len(offsets) == 0:
        raise ValueError("level_set/offsets is no list of places")
    if offsets[0] != 0 or offsets[-1] != len(points) or (np.diff(offsets) < 2).any():
        raise ValueError("level_set/offsets do not cut the points into lines")
    if not isinstance(level, float) or not isinstance(area, float):
        raise ValueError("level_set lacks its level or its area")
    return LevelSet(level, points.astype(np.float64), offsets.astype(np.int64), area)


def lines_columns(lines: LevelSet) -> dict[str, NDArray[Any]]:
    """Lay lines out point by point: the line, and the position, m, body frame.

    Parameters
    ----------
    lines : LevelSet
        On the surface.
    """
    count = np.diff(lines.offsets)
    columns: dict[str, NDArray[Any]] = {"line": np.repeat(np.arange(len(count)), count)}
    return columns | {f"position_m_{axis}": lines.points_m[:, i] for i, axis in enumerate("xyz")}

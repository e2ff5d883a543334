"""What the polyhedron's kernels read: every facet with the edges it owns."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.errors import InputRefused

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def facet_records(vertices: ArrayLike, faces: ArrayLike) -> tuple[FloatArray, FloatArray, float]:
    """Return the records of a mesh's facets, and its volume.

    Every edge is stored once, with one of its two facets. Turn a facet so that its least vertex index comes
    first, (a, b, c): it owns the edge a-b, and b-c where b < c; its neighbours own the others. So every
    facet owns one or two edges, and a kernel meets each edge once, with its corners already at hand.

    Parameters
    ----------
    vertices : (n, 3) float, m
        Corners of the mesh.
    faces : (m, 3) int
        0-based vertex indices, counter-clockwise seen from outside.

    Returns
    -------
    two : (p, 27) float
        Facets that own two edges: the corners a, b, c, the unit normal, twice the area; then for the edge
        a-b its length and its tensor E (xx, yy, zz, xy, xz, yz); then the same for b-c.
    one : (m - p, 20) float
        Facets that own one edge: the same without b-c.
    volume_m3 : float
        Volume that the mesh encloses.

    Raises
    ------
    InputRefused
        The mesh is not closed, has a facet without area, or is wound inwards.
    """
    vertices = np.array(vertices, dtype=np.float64)
    faces = _least_index_first(np.array(faces, dtype=np.int64))
    neighbours = _neighbours(faces)
    corners = vertices[faces]
    area_vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(area_vectors, axis=1)
    _refuse_flat(twice_area)
    volume = np.einsum("fi,fi->", corners.mean(axis=1), area_vectors) / 6.0
    if not volume > 0.0:
        raise InputRefused(
            f"the mesh encloses {volume:g} m3", where="gravity", fix="wind its facets outwards"
        )
    normals = area_vectors / twice_area[:, None]
    edges = [_edge_records(corners, normals, neighbours, i) for i in (0, 1)]
    records = np.hstack([corners.reshape(-1, 9), normals, twice_area[:, None], *edges])
    owns_two = faces[:, 1] < faces[:, 2]
    return records[owns_two], records[~owns_two, :20], float(volume)


def _least_index_first(faces: IntArray) -> IntArray:
    shift = faces.argmin(axis=1)[:, None]
    return np.take_along_axis(faces, (shift + np.arange(3)) % 3, axis=1)


def _neighbours(faces: IntArray) -> IntArray:
    """Facet across the edge from corner i to corner i + 1, (m, 3)."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    count = int(faces.max()) + 1
    there, back = start * count + end, end * count + start
    order, order_back = np.argsort(there), np.argsort(back)
    unmatched = np.flatnonzero(there[order] != back[order_back])
    if len(unmatched) or len(np.unique(there)) < len(there):
        edge = order[unmatched[0]] if len(unmatched) else order[np.argmin(np.diff(there[order]))]
        raise InputRefused(
            "an edge does not belong to exactly two facets",
            where=f"edge {start[edge]}-{end[edge]}, near facet {edge // 3}",
            fix="give a closed mesh",
        )
    facets = np.zeros(len(there), dtype=np.int64)
    facets[order_back] = order // 3
    return facets.reshape(-1, 3)


def _refuse_flat(twice_area: FloatArray) -> None:
    flat = np.flatnonzero(~(twice_area > 0.0))
    if len(flat):
        raise InputRefused(f"{len(flat)} facets without area", where=f"facet {flat[0]}", fix="remove them")


def _edge_records(corners: FloatArray, normals: FloatArray, neighbours: IntArray, i: int) -> FloatArray:
    """Length and E = n_A n_12' + n_B n_21' of the edge that starts at corner ``i`` of every facet, (m, 7)."""
    across = normals[neighbours[:, i]]
    along = corners[:, i + 1] - corners[:, i]
    length = np.linalg.norm(along, axis=1)
    along = along / length[:, None]
    tensor = np.einsum("fi,fj->fij", normals, np.cross(along, normals))
    tensor -= np.einsum("fi,fj->fij", across, np.cross(along, across))
    tensor = 0.5 * (tensor + tensor.transpose(0, 2, 1))
    row, column = np.array([[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]]).T
    return np.column_stack([length, tensor[:, row, column]])


def recorded_corners(params: FloatArray) -> FloatArray:
    """Return the corners that a polyhedron's packed parameters hold.

    Parameters
    ----------
    params : (p,) float
        Of a polyhedron field.

    Returns
    -------
    (m, 3) float, m
        One row for each corner of each facet.
    """
    twos, ones = int(params[0]), int(params[1])
    split = 3 + 27 * twos
    two, one = params[3:split].reshape(twos, 27), params[split:].reshape(ones, 20)
    return np.concatenate([two[:, :9].reshape(-1, 3), one[:, :9].reshape(-1, 3)])

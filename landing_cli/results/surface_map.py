"""The surface in longitude and latitude: facets and lines as they wrap at 180 degrees and at the poles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.body.mesh import Mesh, facet_centroids

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]

_STEP_DEG = 4.0  # straight edges bend on the map: cut into pieces of at most this longitude


def lon_lat_deg(points: ArrayLike) -> FloatArray:
    """Return east longitude in [-180, 180] and latitude about the origin.

    Parameters
    ----------
    points : (..., 3) float
        Body frame.

    Returns
    -------
    (..., 2) float, degree
    """
    x, y, z = np.moveaxis(np.asarray(points, dtype=np.float64), -1, 0)
    return np.degrees(np.stack([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))], axis=-1))


def place_name(point: ArrayLike, digits: int = 0) -> str:
    """Say where a point lies, as ``46.5° S, 1.9° W``; poles have no longitude.

    Parameters
    ----------
    point : (3,) float
        Body frame.
    digits : int
        Decimals of a degree.
    """
    lon, lat = lon_lat_deg(point)
    name = _angle_name(lat, "NS", digits)
    return name if abs(lat) > 89.9 else f"{name}, {_angle_name(lon, 'EW', digits)}"


def _angle_name(angle: float, sides: str, digits: int) -> str:
    number = f"{abs(angle):.{digits}f}°"
    return number if float(number[:-1]) == 0.0 else f"{number} {sides[0] if angle > 0 else sides[1]}"


@dataclass(frozen=True, eq=False)
class SurfaceMap:
    """The facets of a mesh as polygons in longitude and latitude.

    Attributes
    ----------
    polygons : tuple of (k, 2) float, degree
        Some reach beyond 180 degrees; these occur twice, a turn apart.
    owners : (n,) int
        The facet of each polygon; the innermost facets come first, so that outer ones cover them.
    """

    polygons: tuple[FloatArray, ...]
    owners: NDArray[np.int64]


def map_surface(mesh: Mesh) -> SurfaceMap:
    """Lay a mesh out in longitude and latitude.

    Parameters
    ----------
    mesh : Mesh
        The surface about the origin.

    Returns
    -------
    SurfaceMap
    """
    polygons: list[FloatArray] = []
    owners: list[int] = []
    corners = mesh.corners
    for facet in np.argsort(np.linalg.norm(facet_centroids(mesh), axis=1), kind="stable").tolist():
        for polygon in _copies(_facet_polygon(corners[facet])):
            polygons.append(polygon)
            owners.append(facet)
    return SurfaceMap(tuple(polygons), np.array(owners, dtype=np.int64))


def _facet_polygon(corners: FloatArray) -> FloatArray:
    """Outline of a facet; one that holds a pole reaches to the map's edge all around."""
    ring = np.concatenate(
        [_edge(a, b)[:-1] for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    )
    place = _without_poles(ring)
    lon = np.unwrap(np.append(place[:, 0], place[0, 0]), period=360.0)
    around = lon[-1] - lon[0]
    outline = np.stack([lon[:-1], place[:, 1]], axis=1)
    if abs(around) < 180.0:
        return outline
    pole = np.copysign(90.0, corners[:, 2].sum())
    return np.concatenate([outline, [[lon[-1], place[0, 1]], [lon[-1], pole], [lon[0], pole]]])


def _edge(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cut an edge so that it bends as it must; the neighbour that shares it cuts it alike."""
    span = abs((lon_lat_deg(b)[0] - lon_lat_deg(a)[0] + 180.0) % 360.0 - 180.0)
    share = np.linspace(0.0, 1.0, 2 + int(span / _STEP_DEG))[:, None]
    return np.asarray(a + share * (b - a))


def _on_axis(point: FloatArray) -> bool:
    return bool(np.hypot(point[0], point[1]) < 1e-9 * abs(point[2]))


def _without_poles(ring: FloatArray) -> FloatArray:
    """Longitude and latitude of a closed ring; a point at a pole takes its neighbours' longitudes."""
    place = lon_lat_deg(ring)
    polar = [i for i, point in enumerate(ring) if _on_axis(point)]
    for i in reversed(polar):
        before, after = place[i - 1, 0], place[(i + 1) % len(place), 0]
        place = np.concatenate([place[:i], [[before, place[i, 1]], [after, place[i, 1]]], place[i + 1 :]])
    return place


def _copies(polygon: FloatArray) -> list[FloatArray]:
    """Repeat what reaches beyond the map's edge on the other side."""
    west, east = polygon[:, 0].min(), polygon[:, 0].max()
    shifts = [0.0]
    if west < -180.0:
        shifts.append(360.0)
    if east > 180.0:
        shifts.append(-360.0)
    return [polygon + np.array([shift, 0.0]) for shift in shifts]


def draw_facets(axes: Axes, surface: SurfaceMap, colours: FloatArray, hatched: Any = None) -> None:
    """Draw the facets of a map.

    Parameters
    ----------
    axes : Axes
        Where to draw; see :func:`frame_map`.
    surface : SurfaceMap
        The facets.
    colours : (m, 3) float
        Red, green and blue of every facet.
    hatched : (m,) bool, optional
        Facets to hatch.
    """
    from matplotlib.collections import PolyCollection

    paint = colours[surface.owners]
    axes.add_collection(
        PolyCollection(
            surface.polygons, facecolors=paint, edgecolors=paint, linewidths=0.3, antialiaseds=False, zorder=1
        )
    )
    if hatched is not None and hatched.any():
        chosen = [p for p, f in zip(surface.polygons, surface.owners, strict=True) if hatched[f]]
        axes.add_collection(
            PolyCollection(chosen, facecolors="none", edgecolors="white", hatch="////", lw=0, zorder=1.5)
        )


def draw_map_segments(axes: Axes, segments: FloatArray, **look: Any) -> None:
    """Draw straight segments in space as they run on the map.

    Parameters
    ----------
    axes : Axes
        Where to draw.
    segments : (n, 2, 3) float, m
        Their ends.
    **look
        Of a LineCollection.
    """
    from matplotlib.collections import LineCollection

    share = np.linspace(0.0, 1.0, 7)[:, None]
    points = segments[:, :1] + share * (segments[:, 1:] - segments[:, :1])
    place = lon_lat_deg(points)
    place[..., 0] = np.unwrap(place[..., 0], axis=1, period=360.0)
    lines = [copy for line in place if np.ptp(line[:, 0]) < 150.0 for copy in _copies(line)]
    axes.add_collection(LineCollection(lines, capstyle="round", **look))


def frame_map(axes: Axes) -> None:
    """Give a map its limits, ticks and names.

    Parameters
    ----------
    axes : Axes
        A map.
    """
    axes.set(xlim=(-180, 180), ylim=(-90, 90), aspect="equal")
    axes.set(xticks=range(-180, 181, 60), yticks=range(-90, 91, 30))
    axes.set(xlabel="east longitude (°)", ylabel="latitude (°)")
    axes.spines[:].set_visible(True)


def frame_small_map(axes: Axes, *, left: bool, below: bool) -> None:
    """Give one of a grid of maps its limits and ticks; those at the rim say their unit.

    Parameters
    ----------
    axes : Axes
        A map.
    left, below : bool
        Whether it stands at the left and at the lower rim.
    """
    axes.set(xlim=(-180, 180), ylim=(-90, 90), aspect="equal")
    axes.set_xticks([-90, 0, 90], ["90° W", "0°", "90° E"] if below else [])
    axes.set_yticks([-90, -45, 0, 45, 90], ["90° S", "45° S", "0°", "45° N", "90° N"] if left else [])
    axes.tick_params(length=2.5)
    axes.spines[:].set_visible(True)

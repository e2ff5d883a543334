"""The surface seen from far away: orthographic views with equal scales, nothing seen through rock."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.body.mesh import Mesh, facet_normals
from landing_cli.results.plotting import INK, rule_lengths

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]

_AXES = np.eye(3)
_DARKEST = 0.62  # of a shaded facet's colour


@dataclass(frozen=True, eq=False)
class View:
    """An orthographic view of the body frame.

    Attributes
    ----------
    right, up, toward : (3,) float
        Unit vectors of the picture; ``toward`` points to the eye.
    """

    right: FloatArray
    up: FloatArray
    toward: FloatArray

    def flat(self, points: ArrayLike) -> FloatArray:
        """Project points, (..., 3) float, onto the picture, (..., 2)."""
        return np.asarray(points) @ np.stack([self.right, self.up], axis=1)

    def depth(self, points: ArrayLike) -> FloatArray:
        """Return how near points, (..., 3) float, are to the eye."""
        return np.asarray(np.asarray(points) @ self.toward)


def view_from(toward: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0)) -> View:
    """Look at the origin.

    Parameters
    ----------
    toward : (3,) float
        Direction to the eye.
    up : (3,) float
        What is up in the picture; where it lies along the sight, +y is.

    Returns
    -------
    View
    """
    sight = np.asarray(toward, dtype=np.float64)
    sight = sight / np.linalg.norm(sight)
    for wish in (np.asarray(up, dtype=np.float64), _AXES[1], _AXES[0]):
        across = np.cross(wish, sight)
        if np.linalg.norm(across) > 1e-6 * np.linalg.norm(wish):
            break
    across /= np.linalg.norm(across)
    return View(across, np.cross(sight, across), sight)


def label_axes(axes: Axes, view: View) -> None:
    """Name the axes of a view: by the body axis they run along, else by the picture.

    Parameters
    ----------
    axes : Axes
        Where the view is drawn, with its limits set.
    view : View
        The view.
    """
    for ruler, direction, otherwise in (
        (axes.xaxis, view.right, "to the right"),
        (axes.yaxis, view.up, "upwards"),
    ):
        along = int(np.argmax(np.abs(direction)))
        named = abs(direction[along]) > 1.0 - 1e-9
        name = "xyz"[along] if named else otherwise
        rule_lengths(ruler, name, reverse=bool(named and direction[along] < 0.0))
    axes.set_aspect("equal")


def reach_m(mesh: Mesh, view: View) -> float:
    """Return how far from the middle of a view the surface reaches, to a side or up or down, m."""
    return float(np.abs(view.flat(mesh.vertices)).max())


def draw_surface(axes: Axes, mesh: Mesh, view: View, colours: FloatArray, hatched: Any = None) -> None:
    """Draw the facets that face the eye, far ones first, lit from the upper left.

    Parameters
    ----------
    axes : Axes
        Where to draw.
    mesh : Mesh
        The surface, m.
    view : View
        The view.
    colours : (m, 3) float
        Red, green and blue of every facet.
    hatched : (m,) bool, optional
        Facets to hatch.
    """
    from matplotlib.collections import PolyCollection

    normals = facet_normals(mesh)
    front = np.flatnonzero(normals @ view.toward > 0.0)
    front = front[np.argsort(view.depth(mesh.corners[front].mean(axis=1)))]
    light = view.toward + 0.55 * view.up - 0.45 * view.right
    lit = np.clip(normals[front] @ light / np.linalg.norm(light), 0.0, 1.0)
    shaded = colours[front] * (_DARKEST + (1.0 - _DARKEST) * lit)[:, None]
    flat: Any = view.flat(mesh.corners[front])
    axes.add_collection(PolyCollection(flat, facecolors=shaded, edgecolors=shaded, linewidths=0.35, zorder=2))
    if hatched is not None and hatched[front].any():
        chosen = flat[hatched[front]]
        axes.add_collection(
            PolyCollection(chosen, facecolors="none", edgecolors="white", hatch="////", lw=0, zorder=2.1)
        )


def hidden(mesh: Mesh, view: View, points: FloatArray, tolerance_m: float = 1.0) -> NDArray[np.bool_]:
    """Tell which points lie behind or inside the body, as seen by the eye.

    Parameters
    ----------
    mesh : Mesh
        The surface, m.
    view : View
        The view.
    points : (n, 3) float, m
        The points.
    tolerance_m : float, m
        Points of the surface itself, up to this depth, are not hidden.

    Returns
    -------
    (n,) bool
    """
    front = facet_normals(mesh) @ view.toward > 1e-6  # edge-on facets hide nothing
    corners = mesh.corners[front]
    a, b, c = np.moveaxis(view.flat(corners), 1, 0)
    heights = view.depth(corners)
    twice_area = _cross(b - a, c - a)
    answer = np.zeros(len(points), dtype=bool)
    for start in range(0, len(points), 512):  # bounds the memory
        p = view.flat(points[start : start + 512])[:, None]
        u = _cross(b - p, c - p) / twice_area
        v = _cross(c - p, a - p) / twice_area
        inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
        height = u * heights[:, 0] + v * heights[:, 1] + (1.0 - u - v) * heights[:, 2]
        behind = height > view.depth(points[start : start + 512])[:, None] + tolerance_m
        answer[start : start + 512] = (inside & behind).any(axis=1)
    return answer


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def draw_segments(axes: Axes, mesh: Mesh, view: View, segments: FloatArray, **look: Any) -> None:
    """Draw short segments that lie on the surface where the eye sees them.

    Parameters
    ----------
    axes : Axes
        Where to draw.
    mesh : Mesh
        The surface, m.
    view : View
        The view.
    segments : (n, 2, 3) float, m
        Their ends.
    **look
        Of a LineCollection.
    """
    from matplotlib.collections import LineCollection

    depth = 0.01 * float(np.ptp(mesh.vertices))
    seen = ~hidden(mesh, view, segments.mean(axis=1), depth)
    axes.add_collection(LineCollection(list(view.flat(segments[seen])), capstyle="round", **look))


def draw_path(axes: Axes, mesh: Mesh, view: View, points: FloatArray, **look: Any) -> None:
    """Draw a path in space, dotted where the body hides it.

    Parameters
    ----------
    axes : Axes
        Where to draw.
    mesh : Mesh
        The surface, m.
    view : View
        The view.
    points : (n, 3) float, m
        The path.
    **look
        Of a line.
    """
    behind = hidden(mesh, view, points)
    flat = view.flat(points)
    label = look.pop("label", None)
    axes.plot(*np.where(behind[:, None], np.nan, flat).T, label=label, **look)
    dotted = {**look, "linestyle": (0, (0.5, 1.8)), "zorder": look.get("zorder", 3)}
    axes.plot(*np.where(behind[:, None], flat, np.nan).T, **dotted)


def draw_ellipsoid(axes: Axes, view: View, semi_axes_m: FloatArray, **look: Any) -> None:
    """Draw an ellipsoid's outline, and faintly the equator and two meridians on the near side.

    Parameters
    ----------
    axes : Axes
        Where to draw.
    view : View
        The view.
    semi_axes_m : (3,) float, m
        Along the body axes.
    **look
        Of a line.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = np.stack([np.cos(turn), np.sin(turn)])
    squeeze = np.stack([view.right, view.up]) * semi_axes_m
    values, vectors = np.linalg.eigh(squeeze @ squeeze.T)
    outline = vectors @ (np.sqrt(values)[:, None] * circle)
    axes.plot(*outline, **look)
    faint = {**look, "linewidth": 0.5 * look.get("linewidth", 1.0), "alpha": 0.45, "label": None}
    for i, j in ((0, 1), (0, 2), (1, 2)):
        ring = np.zeros((len(turn), 3))
        ring[:, i], ring[:, j] = circle
        near = (ring / semi_axes_m) @ view.toward >= 0.0
        axes.plot(*np.where(near[:, None], view.flat(ring * semi_axes_m), np.nan).T, **faint)


def draw_triad(axes: Axes, view: View, at: tuple[float, float] = (0.11, 0.1), size: float = 0.075) -> None:
    """Draw the body axes in a corner of a view.

    Parameters
    ----------
    axes : Axes
        Where to draw.
    view : View
        The view.
    at : (float, float)
        The triad's origin, in fractions of the axes.
    size : float
        Length of an axis that lies in the picture, in fractions of the axes' width.
    """
    box = axes.get_position()
    width, height = axes.figure.get_figure(root=True).get_size_inches()
    stretch = np.array([1.0, box.width * width / (box.height * height)])
    origin, arms = np.array(at), view.flat(_AXES) * size
    lengths = np.linalg.norm(arms, axis=1)
    look = {"arrowstyle": "-|>,head_width=0.16,head_length=0.3", "lw": 0.9, "color": INK}
    for name, arm, length, axis in zip("xyz", arms, lengths, _AXES, strict=True):
        if length > 0.35 * size:
            tip = origin + arm * stretch
            arrow = {**look, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", (tip[0], tip[1]), at, xycoords="axes fraction", arrowprops=arrow, zorder=6)
            place = origin + arm * (1.0 + 0.028 / length) * stretch
        else:  # along the sight, towards the eye or away from it: named where no other arm is
            name = f"{name} {'⊙' if view.depth(axis) > 0 else '⊗'}"
            rest = arm - arms.sum(axis=0)
            place = origin + 0.045 * rest / np.linalg.norm(rest) * stretch
        axes.text(
            place[0],
            place[1],
            name,
            transform=axes.transAxes,
            ha="center",
            va="center",
            fontsize=7.5,
            zorder=6,
        )


def draw_scale_bar(axes: Axes, half_width_m: float) -> None:
    """Draw a round length at the lower left of a view without axes.

    Parameters
    ----------
    axes : Axes
        With limits of plus and minus ``half_width_m``.
    half_width_m : float, m
        Half the width of the view.
    """
    power = 10.0 ** np.floor(np.log10(0.6 * half_width_m))
    length = max(k * power for k in (1.0, 2.0, 5.0) if k * power <= 0.6 * half_width_m)
    text = f"{length / 1e3:g} km" if length >= 1e3 else f"{length:g} m"
    x, y = -0.95 * half_width_m, -0.97 * half_width_m
    axes.plot([x, x + length], [y, y], color=INK, lw=1.4, solid_capstyle="butt", zorder=6)
    axes.text(x, y + 0.04 * half_width_m, text, ha="left", va="bottom", fontsize=7.5, zorder=6)

"""What the figures of plans share: marks, colours, names, views."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.trajectory import Trajectory
from landing_cli.plan.records import PlanCase
from landing_cli.plan.stored import PlanEntry
from landing_cli.plan.summary import is_sweep
from landing_cli.results import plotting
from landing_cli.results.surface_view import View, draw_surface, view_from

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]

ROCK = (0.80, 0.775, 0.735)
SITE_FACET = (0.94, 0.89, 0.26)
START: Mapping[str, Any] = {
    "marker": "*",
    "markersize": 11,
    "color": "white",
    "markeredgecolor": plotting.INK,
    "markeredgewidth": 0.8,
    "linestyle": "none",
}
TOUCHDOWN: Mapping[str, Any] = {"marker": "o", "color": plotting.RED, "linestyle": "none", "markersize": 5.5}
GUIDE: Mapping[str, Any] = {
    "marker": "D",
    "color": "white",
    "markeredgecolor": plotting.PURPLE,
    "markeredgewidth": 1.2,
    "linestyle": "none",
    "markersize": 5.5,
}
TANGENT: Mapping[str, Any] = {"marker": "x", "color": plotting.PURPLE, "linestyle": "none", "markersize": 6}
LIMIT: Mapping[str, Any] = {"color": plotting.RED, "lw": 1.0, "ls": (0, (4, 2))}

_COLOURS = (plotting.BLUE, plotting.GREEN, plotting.ORANGE, plotting.PURPLE, plotting.SKY, plotting.DARK_GREY)
_SAMPLES = 500

METHODS = {
    "bezier": "Bezier, two guide points",
    "bezier_free_guides": "Bezier, free control points",
    "convex": "free control",
    "pseudospectral": "pseudospectral",
}


def colour_of(index: int, count: int) -> Any:
    """Colour of one of several plans: told apart one by one, or a scale where there are many."""
    if count <= len(_COLOURS):
        return _COLOURS[index]
    from matplotlib import colormaps

    return colormaps["viridis"](0.92 * index / max(1, count - 1))


def label_of(entry: PlanEntry, entries: Sequence[PlanEntry]) -> str:
    """Name a plan among others by what they differ in."""
    if is_sweep(entries):
        return f"{entry.plan.parameters['longitude_deg']:g}°"
    if len({other.plan.method for other in entries}) == 1 and len({e.plan.tof_s for e in entries}) > 1:
        return f"{entry.plan.tof_s:.6g} s"
    return name_of(entry)


def name_of(entry: PlanEntry) -> str:
    """Name a plan by its method and what the method chose."""
    plan = entry.plan
    name = METHODS.get(plan.method, plan.method.replace("_", " "))
    if plan.method == "bezier_free_guides":
        degree = plan.parameters.get("degree")
        return f"{name}, n = {degree}" if degree else name
    if plan.parameters.get("terminal") == "paper":
        return f"{name}, eq 4 at touchdown"
    return name


def title_of(entries: Sequence[PlanEntry]) -> str:
    """Body, site and time of flight."""
    case = entries[0].case
    times = sorted({entry.plan.tof_s for entry in entries})
    told = f"{times[0]:.6g} s" if len(times) == 1 else f"{times[0]:.6g} to {times[-1]:.6g} s"
    where = f"facet {case.site.facet}" if case.site.facet >= 0 else "a given site"
    return f"{case.asteroid.name}: flight to {where} in {told}"


def facts_of(entry: PlanEntry) -> str:
    """What a plan costs, and what it keeps."""
    plan, case = entry.plan, entry.case
    metric = "to the surface" if plan.clearance_metric == "surface" else "to the nearest vertex"
    return (
        f"{name_of(entry)}: {plan.fuel_kg:.2f} kg, at most {plan.peak_thrust_n:.2f} of "
        f"{case.spacecraft.thrust_max_n:g} N, at least {plan.clearance_min_m:.1f} m {metric} before the cone"
    )


def path_of(entry: PlanEntry) -> Trajectory:
    """The plan's path; every plan that is drawn has one."""
    path = entry.trajectory
    assert path is not None
    return path


def thinned(points: FloatArray) -> FloatArray:
    """Enough of the samples to draw a smooth line, the last included."""
    return points[np.unique(np.linspace(0, len(points) - 1, _SAMPLES).round().astype(int))]


def beside_plane(case: PlanCase) -> View:
    """Look square to the plane of the start, the site and its normal, from the side that +z is on."""
    sight = np.cross(case.position_m - case.site.position_m, case.site.normal)
    length = float(np.linalg.norm(sight))
    if length < 1e-6 * np.linalg.norm(case.position_m):
        sight, length = np.array([0.0, 0.0, 1.0]), 1.0
    sight = sight / length
    return view_from(sight if sight[2] >= 0.0 else -sight, (0.0, 1.0, 0.0))


def above_site(case: PlanCase) -> View:
    """Look down on the site along its normal."""
    return view_from(case.site.normal)


def draw_body(axes: Axes, case: PlanCase, view: View) -> None:
    """Draw the body with the landing facet in its own colour."""
    mesh = case.asteroid.mesh
    colours = np.tile([ROCK], (len(mesh.faces), 1))
    if case.site.facet >= 0:
        colours[case.site.facet] = SITE_FACET
    draw_surface(axes, mesh, view, colours)


def frame(axes: Axes, points: FloatArray, margin: float = 0.06) -> None:
    """Set equal limits around points of the picture."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = 0.5 * (low + high), (0.5 + margin) * float((high - low).max())
    axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half))

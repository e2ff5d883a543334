"""Clusters of landmarks: the elbow, and the side that the path is steered to (Shen 2026, figs 6 and 7)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from landing_cli.flight.bezier_curve import bernstein
from landing_cli.observe.figures.parts import (
    CENTRE,
    CONTROL,
    CURVE,
    SITE,
    START,
    UNSTEERED,
    FloatArray,
    colour_of,
    facts_of,
    scene_box,
    site_points,
    title_of,
)
from landing_cli.observe.observed import Clustering
from landing_cli.observe.stored import ObservationEntry
from landing_cli.results import plotting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def field_figure(entries: Sequence[ObservationEntry]) -> Figure:
    """Draw the elbow's curve, and the clusters beside the unsteered path.

    Parameters
    ----------
    entries : sequence of ObservationEntry
        Of one run, at least one.

    Returns
    -------
    Figure
    """
    clustering = entries[0].observation.clustering
    figure = plotting.new_figure(10.4, 5.6)
    plotting.add_title(figure, title_of(entries), facts_of(entries[0].case))
    _draw_elbow(figure.add_axes((0.07, 0.17, 0.33, 0.66)), clustering)
    _draw_clusters(figure.add_axes((0.5, 0.17, 0.42, 0.68)), entries, clustering)
    return figure


def _draw_elbow(axes: Axes, clustering: Clustering) -> None:
    counts = np.arange(1, len(clustering.sse_m2) + 1)
    k = len(clustering.center_m)
    axes.plot(counts, clustering.sse_m2, color=plotting.INK, marker="o", markersize=4)
    if len(counts) > 1:
        ends = [0, len(counts) - 1]
        axes.plot(counts[ends], clustering.sse_m2[ends], color=plotting.GREY, lw=0.9, label="chord")
    if k <= len(counts):
        axes.plot(k, clustering.sse_m2[k - 1], **{**SITE, "markersize": 8})
    axes.set(xlabel="clusters k", ylabel="squared errors $I_{SSE}$ (m²)", yscale="log")
    how = "the elbow" if clustering.chosen_by == "elbow" else "given"
    axes.set_title(f"a  k = {k}: {how}")
    axes.grid(True)


def _draw_clusters(axes: Axes, entries: Sequence[ObservationEntry], clustering: Clustering) -> None:
    case = entries[0].case
    points = case.frame.to_site(case.landmarks.position_m)[:, :2]
    count = len(clustering.center_m)
    for index in range(count):
        own = points[clustering.label == index]
        axes.plot(*own.T, marker="^", ls="none", markersize=4, color=colour_of(index, count))
        if len(own) > 2:
            axes.plot(*_ellipse(own).T, color=colour_of(index, count), lw=0.9, ls=(0, (3, 2)))
    axes.plot(*clustering.center_m.T, **CENTRE, label="centres")
    axes.plot(
        *site_points(case, entries[0].observation.nominal)[:, :2].T, **UNSTEERED, label="unsteered path"
    )
    curves = [e.observation.waypoints.curve_m for e in entries if e.observation.waypoints is not None]
    control = curves[0][1:-1] if curves else clustering.control_points_m
    if curves:
        axes.plot(*bezier(curves[0]).T, **CURVE, label="Bezier curve")
    axes.plot(*control.T, **CONTROL, label="control points")
    axes.plot(*case.frame.to_site(case.position_m)[:2, None], **START, label="initial position")
    axes.plot(0.0, 0.0, **SITE, label="site")
    low, high = scene_box(entries)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set(xlabel="x, east (m)", ylabel="y, north (m)")
    why = {"more_centers": "more centres", "more_landmarks": "more landmarks", "given": "as given"}
    axes.set_title(f"b  steered to the {clustering.steered_to}: {why[clustering.side_chosen_by]}")
    axes.figure.legend(loc="lower center", ncols=7, bbox_to_anchor=(0.5, 0.0))


def bezier(curve_m: FloatArray) -> FloatArray:
    """Sample the curve of some control points, (k, 2) float, m."""
    return np.asarray(bernstein(len(curve_m) - 1, np.linspace(0.0, 1.0, 201)) @ curve_m)


def _ellipse(points: FloatArray) -> FloatArray:
    """The 3 sigma ellipse of points, (k, 2)."""
    values, vectors = np.linalg.eigh(np.cov(points.T))
    turn = np.linspace(0.0, 2.0 * np.pi, 121)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.asarray(points.mean(axis=0) + 3.0 * (circle * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)

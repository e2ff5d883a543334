"""The map of a ranking: the score of every candidate, and the listed sites with what makes their score."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from landing_cli.body.mesh import facet_centroids
from landing_cli.results import plotting
from landing_cli.results.surface_map import draw_facets, frame_map, lon_lat_deg, map_surface
from landing_cli.studies.rank.score import MEASURES, Ranking

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = {
    "margin": plotting.BLUE,
    "delta_v": plotting.ORANGE,
    "slope": plotting.GREEN,
    "roughness": plotting.PURPLE,
}


def rank_figure(ranking: Ranking) -> Figure:
    """Draw a ranking.

    Parameters
    ----------
    ranking : Ranking
        The ranking.

    Returns
    -------
    Figure
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize, to_rgb

    asteroid = ranking.cases[0].case.asteroid
    figure = plotting.new_figure(10.4, 4.3)
    name = asteroid.name[:1].upper() + asteroid.name[1:]
    asked = ranking.cases[0].case.name if len(ranking.cases) == 1 else f"worst of {len(ranking.cases)} cases"
    weights = ", ".join(f"{name} {weight:.3g}" for name, weight in ranking.weights.items())
    plotting.add_title(
        figure,
        f"{name}: landing sites by score, {asked}",
        f"{ranking.candidates.sum()} candidates; weights {weights}; slope in {ranking.gravity} gravity; "
        f"roughness within {ranking.radius_m:.3g} m",
    )
    low, high = float(np.nanmin(ranking.score)), float(np.nanmax(ranking.score))
    scale = ScalarMappable(Normalize(low, high if high > low else low + 1.0), plotting.delta_v_colours())
    colours = scale.to_rgba(np.nan_to_num(ranking.score))[:, :3]
    colours[~ranking.candidates] = to_rgb(plotting.PALE)
    axes = figure.add_axes((0.07, 0.24, 0.56, 0.6))
    draw_facets(axes, map_surface(asteroid.mesh), colours)
    _mark(axes, ranking)
    frame_map(axes)
    bar = figure.add_axes((0.07, 0.1, 0.2, 0.028))
    figure.colorbar(scale, cax=bar, orientation="horizontal", label="score (pale: no candidate)")
    _draw_parts(figure.add_axes((0.73, 0.24, 0.25, 0.6)), ranking)
    return figure


def _mark(axes: Axes, ranking: Ranking) -> None:
    places = lon_lat_deg(facet_centroids(ranking.cases[0].case.asteroid.mesh)[ranking.sites])
    look: dict[str, Any] = {"marker": "o", "color": "white", "markeredgecolor": plotting.INK}
    for rank, (lon, lat) in enumerate(places, start=1):
        axes.plot(lon, lat, markersize=10, zorder=6, clip_on=False, **look)
        axes.text(lon, lat, str(rank), ha="center", va="center_baseline", fontsize=6.5, zorder=7)


def _draw_parts(axes: Axes, ranking: Ranking) -> None:
    rows = np.arange(1, len(ranking.sites) + 1)
    begin = np.zeros(len(rows))
    for name in MEASURES:
        part = ranking.weights[name] * ranking.parts[name][ranking.sites]
        label = name.replace("_", "-")
        axes.barh(rows, part, left=begin, color=_COLOURS[name], label=label, height=0.75)
        begin += part
    axes.set(ylim=(len(rows) + 0.6, 0.4), xlim=(0.0, 1.0), xlabel="score, by what it is made of")
    axes.set_yticks(rows, [f"{rank}: {facet}" for rank, facet in zip(rows, ranking.sites, strict=True)])
    axes.set_ylabel("site: facet")
    axes.legend(loc="upper center", bbox_to_anchor=(0.45, -0.17), ncols=4, columnspacing=0.9, handlelength=1)

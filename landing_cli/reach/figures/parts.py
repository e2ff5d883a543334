"""What the figures of a reach run share: colours and their key, titles, marks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.mesh import FloatArray, facet_areas
from landing_cli.reach.figures.fields import FacetFields, spread_over_mesh
from landing_cli.reach.records import LandingCase
from landing_cli.reach.stored import CaseResult, ReachRun
from landing_cli.results import plotting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable

START: Mapping[str, Any] = {
    "marker": "*",
    "markersize": 11,
    "color": "white",
    "markeredgecolor": plotting.INK,
    "markeredgewidth": 0.8,
    "linestyle": "none",
}
BORDER: Mapping[str, Any] = {"colors": plotting.INK, "linewidths": 1.3, "zorder": 4}
LEVELS: Mapping[str, Any] = {"colors": "white", "linewidths": 0.6, "alpha": 0.8, "zorder": 3}


@dataclass(frozen=True)
class KeyEntry:
    """One kind of facet in a legend."""

    label: str
    colour: str
    is_hatched: bool
    facets: int


@dataclass(frozen=True, eq=False)
class Paint:
    """Colours of the facets, and what they mean.

    Attributes
    ----------
    colours : (m, 3) float
        Red, green and blue.
    hatched : (m,) bool
    key : sequence of KeyEntry
        The kinds of facets that have a colour of their own.
    """

    colours: FloatArray
    hatched: NDArray[np.bool_]
    key: Sequence[KeyEntry]


def paint_verdicts(fields: FacetFields) -> Paint:
    """Colour the facets by what is known about them.

    Parameters
    ----------
    fields : FacetFields
        Of a case.

    Returns
    -------
    Paint
    """
    kinds = [
        ("reachable", plotting.BLUE, fields.reachable & ~fields.rock),
        ("reachable, the path cuts rock", plotting.PURPLE, fields.rock),
        ("unreachable, proved", plotting.DARK_GREY, fields.proved),
        ("unreachable, not proved", plotting.GREY, fields.unreachable & ~fields.proved),
    ]
    return _paint(kinds, fields, np.zeros((len(fields.asked), 3)))


def paint_delta_v(fields: FacetFields, scale: ScalarMappable) -> Paint:
    """Colour the reachable facets by velocity increment.

    Parameters
    ----------
    fields : FacetFields
        Of a case.
    scale : ScalarMappable
        Colours of velocity increments, m/s.

    Returns
    -------
    Paint
    """
    colours = scale.to_rgba(np.nan_to_num(fields.delta_v_m_s))[:, :3]
    return _paint([("unreachable", plotting.GREY, fields.unreachable)], fields, colours)


def _paint(
    kinds: list[tuple[str, str, NDArray[np.bool_]]], fields: FacetFields, colours: FloatArray
) -> Paint:
    from matplotlib.colors import to_rgb

    unknown = [
        ("unresolved", plotting.RED, fields.unresolved),
        ("not asked", plotting.PALE, ~fields.asked),
    ]
    key = []
    for label, colour, facets in kinds + unknown:
        colours[facets] = to_rgb(colour)
        if facets.any():
            key.append(KeyEntry(label, colour, label == "unresolved", int(facets.sum())))
    return Paint(colours, fields.unresolved, key)


def delta_v_scale(run: ReachRun) -> ScalarMappable:
    """Make the colour scale that all cases of a run share, so that their maps compare.

    Parameters
    ----------
    run : ReachRun
        The run.

    Returns
    -------
    ScalarMappable
        From the least to the largest velocity increment, m/s, rounded outwards.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    values = np.concatenate([spread_over_mesh(case).delta_v_m_s for case in run.cases])
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    step = 0.5 * _level_step(low, high)
    low, high = step * np.floor(low / step), step * np.ceil(high / step)
    return ScalarMappable(Normalize(low, high if high > low else low + step), plotting.delta_v_colours())


def scale_levels(scale: ScalarMappable) -> FloatArray:
    """Round velocity increments at which to draw lines, m/s, (k,) float."""
    low, high = scale.get_clim()
    step = _level_step(low, high)
    return np.arange(np.ceil(low / step), np.floor(high / step) + 1.0) * step


def _level_step(low: float, high: float) -> float:
    """Step that parts a range into some four to ten."""
    span = max(high - low, 1e-3)
    power = 10.0 ** np.floor(np.log10(span / 4.0))
    return float(max(step for step in (power, 2.0 * power, 5.0 * power) if step <= span / 4.0))


def legend_handles(
    key: Sequence[KeyEntry], *, border: bool, levels: ScalarMappable | None, counts: bool
) -> list[Any]:
    """Make the entries of a map's legend.

    Parameters
    ----------
    key : sequence of KeyEntry
        Kinds of facets.
    border : bool
        Whether a boundary is drawn.
    levels : ScalarMappable or None
        Whose levels are drawn, if any are.
    counts : bool
        Whether to say how many facets are of a kind.

    Returns
    -------
    list of artists
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: list[Any] = []
    for kind in key:
        hatch: dict[str, Any] = {}
        if kind.is_hatched:
            hatch = {"hatch": "////", "edgecolor": "white", "linewidth": 0}
        label = f"{kind.label} ({kind.facets})" if counts else kind.label
        entries.append(Patch(facecolor=kind.colour, label=label, **hatch))
    if border:
        entries.append(Line2D([], [], color=plotting.INK, lw=1.3, label="boundary of the reachable facets"))
    if levels is not None:
        step = _level_step(*levels.get_clim())
        entries.append(
            Line2D([], [], color=plotting.GREY, lw=1.0, label=f"every {step:g} m/s (drawn in white)")
        )
    entries.append(Line2D([], [], **{**START, "markersize": 10}, label="initial position"))
    return entries


def body_name(case: LandingCase) -> str:
    """Return the body's name as a title begins."""
    name = case.asteroid.name
    return name[:1].upper() + name[1:]


def case_title(result: CaseResult) -> str:
    """Name body and case, and say how many facets are reachable, of all or of those that were asked."""
    fields = spread_over_mesh(result)
    found, asked = int(fields.reachable.sum()), int(fields.asked.sum())
    facets = "facets" if fields.asked.all() else "facets asked"
    share = f"{found} of {asked} {facets} reachable ({100.0 * found / max(asked, 1):.1f} %)"
    area_km2 = facet_areas(result.case.asteroid.mesh)[fields.reachable].sum() / 1e6
    area = f"{area_km2:.3f} km²" if area_km2 < 10.0 else f"{area_km2:.0f} km²"
    return f"{body_name(result.case)}, {result.case.name}: {share}, {area}"


def case_facts(case: LandingCase) -> str:
    """Say in one line what was flown."""
    return f"{case.tof_s:g} s of flight; {craft_facts(case)}"


def craft_facts(case: LandingCase) -> str:
    """Say what the cases of a run share: spacecraft and reading of the two stages."""
    craft = case.spacecraft
    reading = "outside" if case.handover == "outside" else "on"
    return (
        f"final stage {_stage(case)} s; "
        f"{craft.mass_kg:g} kg, {craft.thrust_max_n:g} N, Isp {craft.isp_s:g} s; "
        f"handover {reading} the ellipsoid; {case.descent} descent"
    )


def _stage(case: LandingCase) -> str:
    free = case.free_final_stage
    return f"{case.final_stage_s:g}" if free is None else f"{free.shortest_s:g} to {free.longest_s:g}"


def sights(start: FloatArray, off_deg: float = 30.0) -> tuple[FloatArray, FloatArray]:
    """Choose directions to the eye that suit an initial position.

    Parameters
    ----------
    start : (3,) float, m
        Initial position.
    off_deg : float, degree
        How far off the initial position the near one is.

    Returns
    -------
    near, beside : (3,) float
        Beside the initial position, and at right angles to it.
    """
    up = start / np.linalg.norm(start)
    beside = np.cross(up, (0.0, 0.0, 1.0))
    if np.linalg.norm(beside) < 1e-6:  # over a pole
        beside = np.array([0.0, -1.0, 0.0])
    beside /= np.linalg.norm(beside)
    askew = np.sqrt(0.75) * beside + 0.5 * np.cross(up, beside)
    off = np.deg2rad(off_deg)
    return np.cos(off) * up + np.sin(off) * askew, beside


def draw_arrow_head(axes: Axes, tip: FloatArray, toward_tail: FloatArray) -> None:
    """Draw the head of an arrow whose line is drawn already, (2,) float each."""
    look = {"arrowstyle": "-|>", "lw": 1.0, "color": plotting.INK, "shrinkA": 0, "shrinkB": 0}
    neck = tip + 0.02 * (toward_tail - tip)
    axes.annotate("", (tip[0], tip[1]), (neck[0], neck[1]), arrowprops=look, zorder=5)

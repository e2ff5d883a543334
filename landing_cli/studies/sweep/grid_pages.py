"""A quantity over the grid of a sweep: curves over one axis, heat maps over two, panels over more."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.results import plotting
from landing_cli.studies.sweep.axes import Axis
from landing_cli.studies.sweep.records import SweepRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

MOST_PANELS = 48
MOST_CELLS_TOLD = 200  # of a panel, with a number in each
_COLOURS = (plotting.BLUE, plotting.RED, plotting.GREEN, plotting.ORANGE, plotting.PURPLE, plotting.SKY)
_STYLES = ("-", "--", ":", "-.")
_LEFT, _TOP, _BOTTOM, _GAP = 0.85, 0.9, 0.55, 0.45  # inch


@dataclass(frozen=True, eq=False)
class Quantity:
    """What is drawn over the grid.

    Attributes
    ----------
    name : str
        Of the file.
    label : str
        With its unit.
    values : (cases,) float
        Cell after cell, state after state; NaN where there is none.
    """

    name: str
    label: str
    values: FloatArray


def grid_figures(run: SweepRun, quantity: Quantity) -> Iterator[tuple[str, Figure]]:
    """Draw a quantity over the grid.

    Parameters
    ----------
    run : SweepRun
        The sweep.
    quantity : Quantity
        Of every case.

    Yields
    ------
    str
        Last part of the file's name.
    Figure
        One; over three and more axes one an initial state.

    Raises
    ------
    InputRefused
        If the axes beyond the second have too many values to be drawn side by side.
    """
    axes, states = run.grid.question.axes, run.grid.states
    values = quantity.values.reshape(*run.grid.question.shape, len(states))
    if len(axes) == 1:
        yield quantity.name, _curves(run, quantity, values)
        return
    if len(axes) == 2:
        panels = [(state, values[..., place]) for place, state in enumerate(states)]
        yield quantity.name, _heat_maps(run, quantity, panels, "")
        return
    rest = list(product(*(range(len(axis.texts)) for axis in axes[2:])))
    if len(rest) > MOST_PANELS:
        raise InputRefused(
            f"{len(rest)} panels an initial state do not fit a page",
            fix=f"at most {MOST_PANELS} values of the axes beyond the second; `landing results export` "
            "writes the table",
        )
    for place, state in enumerate(states):
        panels = [
            (_told(axes[2:], choice), np.moveaxis(values, (0, 1), (-2, -1))[(*choice, place)])
            for choice in rest
        ]
        yield f"{quantity.name}-{state}", _heat_maps(run, quantity, panels, f" from {state}")


def _told(axes: Sequence[Axis], choice: Sequence[int]) -> str:
    return ", ".join(f"{axis.name} = {axis.texts[i]}" for axis, i in zip(axes, choice, strict=True))


def _curves(run: SweepRun, quantity: Quantity, values: FloatArray) -> Figure:
    axis = run.grid.question.axes[0]
    figure = plotting.new_figure(6.4, 3.9)
    _head(figure, run, quantity, "")
    frame = figure.add_axes((0.12, 0.15, 0.58, 0.6))
    x = _places(axis)
    for place, state in enumerate(run.grid.states):
        look: dict[str, Any] = {
            "color": _COLOURS[place % len(_COLOURS)],
            "linestyle": _STYLES[(place // len(_COLOURS)) % len(_STYLES)],
        }
        frame.plot(x, values[:, place], marker="o", markersize=3.5, label=state.replace("_", " "), **look)
    _rule(frame, axis)
    frame.set_ylabel(quantity.label)
    frame.grid(True)
    if np.isfinite(values).any():
        frame.set_ylim(bottom=0.0 if np.nanmin(values) < 0.4 * np.nanmax(values) else None)
    figure.legend(loc="upper left", bbox_to_anchor=(0.72, 0.77), title="initial state")
    return figure


def _heat_maps(
    run: SweepRun, quantity: Quantity, panels: Sequence[tuple[str, FloatArray]], whence: str
) -> Figure:
    """One panel beside another: the first axis to the right, the second upwards."""
    across, up = run.grid.question.axes[:2]
    columns = min(len(panels), 4)
    rows = -(-len(panels) // columns)
    width = min(max(0.42 * len(across.texts), 1.7), 4.2)
    height = min(max(0.3 * len(up.texts), 1.5), 3.6)
    page = (_LEFT + columns * (width + _GAP) + 0.9, _TOP + rows * height + (rows - 1) * _GAP + _BOTTOM)
    figure = plotting.new_figure(max(page[0], 6.0), page[1])
    _head(figure, run, quantity, whence)
    scale = _scale(np.concatenate([panel.ravel() for _, panel in panels]))
    wide, high = figure.get_size_inches()
    for place, (title, panel) in enumerate(panels):
        row, column = divmod(place, columns)
        left = _LEFT + column * (width + _GAP)
        bottom = page[1] - _TOP - (row + 1) * height - row * _GAP
        frame = figure.add_axes((left / wide, bottom / high, width / wide, height / high))
        _heat(frame, panel, scale, width, height)
        frame.set_title(title.replace("_", " "))
        below = place + columns >= len(panels)
        _tick(frame, across, horizontal=True, named=below)
        _tick(frame, up, horizontal=False, named=column == 0)
    bar_left = _LEFT + columns * (width + _GAP) - 0.15
    top = page[1] - _TOP
    bar = figure.add_axes((bar_left / wide, (top - height) / high, 0.13 / wide, height / high))
    figure.colorbar(scale, cax=bar).outline.set_visible(False)
    return figure


def _heat(frame: Axes, panel: FloatArray, scale: ScalarMappable, width: float, height: float) -> None:
    colours = scale.to_rgba(np.ma.masked_invalid(panel.T))
    colours[~np.isfinite(panel.T)] = (*_rgb(plotting.PALE), 1.0)
    frame.imshow(colours, origin="lower", aspect="auto", interpolation="nearest")
    frame.spines[:].set_visible(False)
    frame.tick_params(length=2.0)
    low, high = scale.get_clim()
    room = width / panel.shape[0] >= 0.3 and height / panel.shape[1] >= 0.16
    if panel.size > MOST_CELLS_TOLD or not room:
        return
    for (i, k), value in np.ndenumerate(panel):
        dark = np.isfinite(value) and value < low + 0.55 * (high - low)
        told = f"{value:.3g}" if np.isfinite(value) else "-"
        frame.text(
            i, k, told, ha="center", va="center", fontsize=6.5, color="white" if dark else plotting.INK
        )


def _rgb(colour: str) -> tuple[float, float, float]:
    from matplotlib.colors import to_rgb

    return to_rgb(colour)


def _scale(values: FloatArray) -> ScalarMappable:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    return ScalarMappable(Normalize(low, high if high > low else low + 1.0), plotting.delta_v_colours())


def _head(figure: Figure, run: SweepRun, quantity: Quantity, whence: str) -> None:
    name = run.asteroid.name[:1].upper() + run.asteroid.name[1:]
    shape = " x ".join(f"{len(axis.texts)} {axis.name}" for axis in run.grid.question.axes)
    label = quantity.label[:1].upper() + quantity.label[1:]
    plotting.add_title(figure, f"{name}: {label}{whence}", f"{shape}; {run.grid.facets} facets a cell")


def _places(axis: Axis) -> FloatArray:
    return np.array(axis.values if axis.is_numeric else range(len(axis.texts)), dtype=np.float64)


def _rule(frame: Axes, axis: Axis) -> None:
    """Name a horizontal axis; words stand at whole numbers."""
    frame.set_xlabel(_axis_label(axis))
    if not axis.is_numeric:
        frame.set_xticks(range(len(axis.texts)), axis.texts)
        frame.margins(x=0.2)


def _tick(frame: Axes, axis: Axis, *, horizontal: bool, named: bool) -> None:
    count, most = len(axis.texts), 5 if horizontal else 8
    chosen = list(range(0, count, -(-count // most)))
    labels = [axis.texts[i] for i in chosen] if named else [""] * len(chosen)
    if horizontal:
        frame.set_xticks(chosen, labels)
        frame.set_xlabel(_axis_label(axis) if named else "")
    else:
        frame.set_yticks(chosen, labels)
        frame.set_ylabel(_axis_label(axis) if named else "")


def _axis_label(axis: Axis) -> str:
    """As ``reach.tof_s``: the key says what it is, and its unit."""
    return axis.key

"""The common style of figures, and PNG files that are equal byte for byte when their data are."""

from __future__ import annotations

import io
from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from landing_cli.errors import OutputRefused
from landing_cli.results.disk import replace_file

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

DPI = 150
_COLOUR_STEP = 5  # of 255, which it divides

# Okabe and Ito's colours, told apart with any colour vision, and neutral tones
BLUE, SKY, GREEN, YELLOW = "#0072B2", "#56B4E9", "#009E73", "#F0E442"
ORANGE, RED, PURPLE = "#E69F00", "#D55E00", "#CC79A7"
INK, DARK_GREY, GREY, PALE, ROCK = "#1f2328", "#7f7b74", "#c6c2bb", "#e9e6e1", "#cfc8bd"

_TICK = "#57606a"
STYLE: Mapping[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titlepad": 5.0,
    "axes.labelsize": 9.0,
    "axes.linewidth": 0.7,
    "axes.edgecolor": _TICK,
    "axes.labelcolor": INK,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "xtick.color": _TICK,
    "ytick.color": _TICK,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "text.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "legend.handlelength": 1.6,
    "lines.linewidth": 1.6,
    "hatch.linewidth": 0.7,
    "grid.color": "#d8dee4",
    "grid.linewidth": 0.6,
}


def style() -> AbstractContextManager[None]:
    """Return a context in which figures are made alike, whatever the user's matplotlibrc says."""
    import matplotlib.style

    return matplotlib.style.context(dict(STYLE), after_reset=True)


def new_figure(width_in: float, height_in: float) -> Figure:
    """Make an empty figure that no global state knows of.

    Parameters
    ----------
    width_in, height_in : float, inch
        At 150 pixels an inch.

    Returns
    -------
    Figure
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), dpi=DPI, facecolor="white")


def add_title(figure: Figure, title: str, subtitle: str = "", top_in: float = 0.12) -> None:
    """Write what a figure shows at its upper left.

    Parameters
    ----------
    figure : Figure
        The figure.
    title, subtitle : str
        One line each; a second line of the subtitle takes 0.17 inch more.
    top_in : float, inch
        Distance of the title from the upper edge.
    """
    width, height = figure.get_size_inches()
    left = 0.12 / width
    look: dict[str, Any] = {"ha": "left", "va": "top", "parse_math": False}
    figure.text(left, 1 - top_in / height, title, fontsize=12, fontweight="bold", **look)
    figure.text(left, 1 - (top_in + 0.27) / height, subtitle, fontsize=9, color=_TICK, **look)


def rule_lengths(ruler: Axis, name: str, *, reverse: bool = False) -> None:
    """Name an axis of lengths in m, and count it in km where it spans more than a few.

    Parameters
    ----------
    ruler : Axis
        With its limits set, m.
    name : str
        What is measured.
    reverse : bool
        Whether to print the values with the other sign.
    """
    low, high = ruler.get_view_interval()
    unit, metres = ("km", 1e3) if high - low > 4e3 else ("m", 1.0)
    sign = -1.0 if reverse else 1.0
    ruler.set_label_text(f"{name} ({unit})")
    ruler.set_major_formatter(
        lambda value, _: f"{sign * value / metres + 0.0:g}".replace("-", "\N{MINUS SIGN}")
    )


def delta_v_colours() -> Colormap:
    """Return the colour map of velocity increments: cheap is dark, dear is light."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps["viridis"](np.arange(20, 256)))


def to_png(figure: Figure) -> bytes:
    """Draw a figure; the same figure gives the same bytes.

    Parameters
    ----------
    figure : Figure
        The figure.

    Returns
    -------
    bytes
        A PNG file without dates and program names. Colours are rounded to steps of 2 %, which nobody
        sees and which halves the file.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    canvas: Any = FigureCanvasAgg(figure)  # partly untyped
    canvas.draw()
    drawn = np.asarray(canvas.buffer_rgba())[..., :3].astype(np.uint16)
    rounded = ((drawn + _COLOUR_STEP // 2) // _COLOUR_STEP * _COLOUR_STEP).astype(np.uint8)
    buffer = io.BytesIO()
    Image.fromarray(rounded).save(buffer, "PNG", compress_level=7, dpi=(DPI, DPI))
    return buffer.getvalue()


def write_png(figure: Figure, path: Path) -> None:
    """Draw a figure into a file, whole or not at all.

    Parameters
    ----------
    figure : Figure
        The figure.
    path : Path
        Where; what is there is replaced.

    Raises
    ------
    OutputRefused
        If it cannot be written.
    """
    try:
        replace_file(path, to_png(figure))
    except OutputRefused as error:
        fix = "choose another folder with --out"
        raise OutputRefused(error.what, where=error.where, fix=fix) from error

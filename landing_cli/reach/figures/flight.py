"""The flight to a facet: histories of its state and control (Zhao 2022, figs 6 and 11)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from landing_cli.body.mesh import FloatArray, facet_centroids, facet_normals
from landing_cli.flight.trajectory import Trajectory
from landing_cli.reach.figures.parts import body_name
from landing_cli.reach.flown import case_of_row, row_of
from landing_cli.reach.records import LandingCase
from landing_cli.reach.stored import CaseResult
from landing_cli.results import plotting
from landing_cli.results.surface_map import place_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COMPONENTS = (("x", plotting.BLUE), ("y", plotting.ORANGE), ("z", plotting.GREEN))
HANDOVER: dict[str, Any] = {"marker": "^", "color": plotting.RED, "linestyle": "none", "markersize": 7}
TOUCHDOWN: dict[str, Any] = {"marker": "o", "color": plotting.RED, "linestyle": "none", "markersize": 6.5}


@dataclass(frozen=True, eq=False)
class Flight:
    """A flown trajectory to a facet of a case."""

    result: CaseResult
    facet: int
    path: Trajectory

    @property
    def case(self) -> LandingCase:
        """The case that it belongs to, with the facet's own duration of the final stage."""
        return case_of_row(self.result.case, self.result.solutions, row_of(self.result, self.facet))

    @property
    def handover(self) -> int:
        """Sample at which the final stage begins."""
        return int(np.argmin(np.abs(self.path.t_s - self.case.descent_s)))

    @property
    def target_m(self) -> FloatArray:
        """Landing point, (3,) float, m."""
        return facet_centroids(self.case.asteroid.mesh)[self.facet]

    @property
    def normal(self) -> FloatArray:
        """Outward normal of the facet, (3,) float."""
        return facet_normals(self.case.asteroid.mesh)[self.facet]

    @property
    def title(self) -> str:
        """Body, case, facet."""
        where = place_name(self.target_m, digits=1)
        return f"{body_name(self.case)}, {self.case.name}: flight to facet {self.facet} ({where})"

    @property
    def facts(self) -> str:
        """What the flight costs."""
        row = self.result.solutions.rows[row_of(self.result, self.facet)]
        return (
            f"velocity increment {row['delta_v_m_s']:.3f} m/s, propellant {row['fuel_kg']:.3f} kg, "
            f"J {row['performance_index_m2_s3']:.4g} m²/s³, "
            f"largest thrust {100 * row['peak_thrust_ratio']:.1f} % of the bound; open-loop re-flight"
        )


def histories_figure(flight: Flight) -> Figure:
    """Draw position, velocity, thrust, mass and margins of a flight over time.

    Parameters
    ----------
    flight : Flight
        The flight.

    Returns
    -------
    Figure
    """
    path, case = flight.path, flight.case
    figure = plotting.new_figure(10.0, 7.6)
    plotting.add_title(figure, flight.title, flight.facts)
    grid = figure.add_gridspec(
        3, 2, left=0.075, right=0.985, top=0.875, bottom=0.105, hspace=0.34, wspace=0.2
    )
    panels = [[figure.add_subplot(grid[i, k]) for k in range(2)] for i in range(3)]
    _draw_vector(panels[0][0], path.t_s, path.position_m, "|r|")
    panels[0][0].set_title("a  position, body frame")
    plotting.rule_lengths(panels[0][0].yaxis, "position")
    _draw_vector(panels[0][1], path.t_s, path.velocity_m_s, "|v|")
    panels[0][1].set(ylabel="velocity (m/s)", title="b  velocity relative to the rotating body")
    _draw_vector(panels[1][0], path.t_s, path.thrust_n, "|T|", _stairs(flight))
    bound = case.spacecraft.thrust_max_n
    panels[1][0].axhline(bound, color=plotting.INK, lw=0.9, ls=(0, (4, 2)), label="bound")
    panels[1][0].axhline(-bound, color=plotting.INK, lw=0.9, ls=(0, (4, 2)))
    panels[1][0].set(ylabel="thrust (N)", ylim=(-1.12 * bound, 1.3 * bound), title="c  thrust, body frame")
    panels[1][1].plot(path.t_s, path.mass_kg, color=plotting.INK)
    panels[1][1].set(ylabel="mass (kg)", title="d  mass")
    panels[1][1].ticklabel_format(useOffset=False)
    _draw_ellipsoid_margin(panels[2][0], flight)
    _draw_glide_angle(panels[2][1], flight)
    for panel in (panel for row in panels for panel in row):
        panel.axvspan(case.descent_s, case.tof_s, color=plotting.PALE, lw=0, zorder=0)
        panel.set_xlim(0.0, case.tof_s)
        panel.grid(True)
    for panel in panels[2]:
        panel.set_xlabel("time (s)")
    _explain(figure)
    return figure


def _stairs(flight: Flight) -> int:
    """Count the samples of a descent by thrust nodes: between these the thrust is constant."""
    row = flight.result.solutions.rows[row_of(flight.result, flight.facet)]
    return flight.handover if row["thrust_nodes"] > 0 else 0


def _draw_vector(axes: Axes, t_s: FloatArray, values: FloatArray, size: str, stairs: int = 0) -> None:
    curves = [(name, colour, values[:, i], 1.4) for i, (name, colour) in enumerate(COMPONENTS)]
    curves.append((size, plotting.INK, np.linalg.norm(values, axis=1), 1.9))
    for name, colour, curve, width in curves:
        look: dict[str, Any] = {"color": colour, "lw": width}
        axes.plot(t_s[: stairs + 1], curve[: stairs + 1], drawstyle="steps-post", **look)
        axes.plot(t_s[stairs:], curve[stairs:], label=name, **look)
    axes.axhline(0.0, color=plotting.DARK_GREY, lw=0.6)
    axes.legend(ncols=5, loc="best", columnspacing=1.0, handlelength=1.1)


def _draw_ellipsoid_margin(axes: Axes, flight: Flight) -> None:
    scaled = flight.path.position_m / flight.case.ellipsoid_m
    margin = (scaled**2).sum(axis=1) - 1.0
    axes.plot(flight.path.t_s, margin, color=plotting.INK)
    axes.axhline(0.0, color=plotting.RED, lw=1.0, ls=(0, (4, 2)))
    least = float(margin[: flight.handover + 1].min())
    top = min(float(margin.max()), max(1.0, 5.0 * least))
    axes.set(ylabel="r'Rₑr − 1", ylim=(min(1.2 * float(margin.min()), -0.1), 1.1 * top))  # noqa: RUF001
    axes.set_title(f"e  ellipsoid margin: least {least:.2g} until handover")


def _draw_glide_angle(axes: Axes, flight: Flight) -> None:
    """Angle at the landing point between the facet normal and the spacecraft, over the final stage."""
    final = slice(flight.handover, -1)
    offset = flight.path.position_m[final] - flight.target_m
    along = offset @ flight.normal
    across = np.linalg.norm(offset - along[:, None] * flight.normal, axis=1)
    away = np.linalg.norm(offset, axis=1) > 1e-3
    angle = np.degrees(np.arctan2(across, along))
    limit = np.degrees(flight.case.glide_slope_half_angle_rad)
    axes.plot(flight.path.t_s[final][away], angle[away], color=plotting.INK)
    axes.axhline(limit, color=plotting.RED, lw=1.0, ls=(0, (4, 2)))
    axes.set(ylabel="angle from the normal (°)", ylim=(0.0, 1.2 * max(limit, angle[away].max())))
    axes.set_title(f"f  glide slope: at most {angle[away].max():.1f}° of {limit:.0f}°")


def _explain(figure: Figure) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = [
        Patch(color=plotting.PALE, label="final landing stage"),
        Line2D([], [], color=plotting.INK, lw=0.9, ls=(0, (4, 2)), label="thrust bound"),
        Line2D([], [], color=plotting.RED, lw=1.0, ls=(0, (4, 2)), label="limit"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=3, bbox_to_anchor=(0.53, 0.002))

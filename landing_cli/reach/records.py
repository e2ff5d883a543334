"""What a landing case asks and what a facet's solve answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.results.columns import Column

FloatArray = NDArray[np.float64]


class Verdict(IntEnum):
    """What is known about a facet."""

    UNRESOLVED = 0
    REACHABLE = 1
    UNREACHABLE = 2


class Binding(IntEnum):
    """The constraint that shapes the best path, or that stops it."""

    NONE = 0
    THRUST = 1
    ELLIPSOID = 2
    GLIDE_SLOPE = 3
    PROPELLANT = 4
    TERRAIN = 5
    HANDOVER = 6


@dataclass(frozen=True)
class FreeFinalStage:
    """Durations that the final stage may take, facet by facet.

    Attributes
    ----------
    shortest_s, longest_s : float, s
    compared_s : float or None, s
        A duration that is tried for every facet, to tell what the others add to the domain.
    """

    shortest_s: float
    longest_s: float
    compared_s: float | None = None


@dataclass(frozen=True, eq=False)
class LandingCase:
    """One initial state and one time of flight over one asteroid.

    Attributes
    ----------
    name : str
        ``<initial state>_<tof>s``.
    asteroid : Asteroid
    spacecraft : Spacecraft
    position_m, velocity_m_s : (3,) float, body frame
        Initial state; the velocity is relative to the rotating frame.
    tof_s, final_stage_s : float, s
        Time of flight, and the part of it that the final landing stage takes.
    free_final_stage : FreeFinalStage or None
        Where the duration is chosen for each facet; ``final_stage_s`` is then one that is allowed.
    ellipsoid_m : (3,) float, m
        Semi-axes of the keep-out ellipsoid of the descent stage.
    glide_slope_half_angle_rad : float, rad
        Half-angle of the final stage's cone about the facet normal.
    handover : {"outside", "on_ellipsoid"}
        Where the descent stage may end.
    final_stage_thrust : {"compensated", "paper"}
        Whether the final stage's thrust bound holds for the real thrust or for eq 14 alone.
    descent : {"free", "extremal"}
        The family of descent trajectories.
    terrain : {"report", "require"}
        Whether a path that cuts the mesh is a landing.
    margin : bool
        Whether every facet is asked for its least thrust level.
    """

    name: str
    asteroid: Asteroid
    spacecraft: Spacecraft
    position_m: FloatArray
    velocity_m_s: FloatArray
    tof_s: float
    final_stage_s: float
    ellipsoid_m: FloatArray
    glide_slope_half_angle_rad: float
    handover: Literal["outside", "on_ellipsoid"] = "outside"
    final_stage_thrust: Literal["compensated", "paper"] = "compensated"
    descent: Literal["free", "extremal"] = "free"
    terrain: Literal["report", "require"] = "report"
    margin: bool = False
    free_final_stage: FreeFinalStage | None = None

    @property
    def descent_s(self) -> float:
        """Time of flight of the descent stage, s."""
        return self.tof_s - self.final_stage_s

    def with_final_stage(self, duration_s: float) -> LandingCase:
        """Return the case with one duration of the final stage, s, for all facets."""
        return replace(self, final_stage_s=duration_s, free_final_stage=None)


FACET_COLUMNS: tuple[Column, ...] = (
    Column("facet", "i4", "1", "facet, 0-based, in the shape file's order"),
    Column("verdict", "u1", "1", "what is known about the facet", flags=Verdict),
    Column("proved", "u1", "1", "1 where an unreachable facet is certified by a dual bound"),
    Column("performance_index_m2_s3", "f8", "m2 s-3", "two-stage energy J (Zhao 2022, eq 7)"),
    Column("delta_v_m_s", "f8", "m s-1", "velocity increment of the thrust"),
    Column("fuel_kg", "f8", "kg", "propellant used"),
    Column("peak_thrust_ratio", "f8", "1", "largest thrust over its bound, both stages"),
    Column("peak_thrust_ratio_descent", "f8", "1", "largest thrust ratio of the descent stage"),
    Column("peak_thrust_ratio_final", "f8", "1", "largest thrust ratio of the final stage"),
    Column("ellipsoid_margin", "f8", "1", "least r'Re r - 1 along the descent stage"),
    Column("glide_slope_margin_deg", "f8", "degree", "least angle inside the glide-slope cone"),
    Column(
        "terrain_clearance_min_m",
        "f8",
        "m",
        "least signed distance of the path to the surface, beyond one mean edge from touchdown; "
        "negative where the path cuts rock anywhere",
    ),
    Column("violation", "f8", "1", "least constraint violation, scaled; 0 where reachable"),
    Column("binding", "u1", "1", "constraint that binds", flags=Binding),
    Column(
        "thrust_margin",
        "f8",
        "1",
        "1 - tau, tau the least share of the thrust bound at which free control reaches the facet",
    ),
    Column(
        "thrust_level_bound",
        "f8",
        "1",
        "certified lower bound on tau, ellipsoid left out; at least 1 where proved",
    ),
    Column(
        "thrust_level_flown",
        "f8",
        "1",
        "upper bound on tau: largest share of the thrust bound in a flight that keeps every other limit",
    ),
    Column("final_stage_s", "f8", "s", "duration of the final stage"),
    Column(
        "compared_verdict",
        "u1",
        "1",
        "what is known with the compared duration of the final stage; unresolved where none is compared",
        flags=Verdict,
    ),
    Column("iterations", "i4", "1", "solver iterations"),
    Column("handover_position_m", "f8", "m", "handover position, body frame", (3,)),
    Column("handover_velocity_m_s", "f8", "m s-1", "handover velocity, rotating frame", (3,)),
    Column("handover_mass_kg", "f8", "kg", "mass at handover"),
    Column(
        "costates",
        "f8",
        "1",
        "initial costates (r, v, m) of the descent stage, body frame, scaled by length a0 tp^2, "
        "time tp and mass m0 with lambda0 = 1/2",
        (7,),
    ),
    Column("thrust_nodes", "i4", "1", "number of stored thrust nodes of the descent stage"),
)

FACET_DTYPE = np.dtype([(c.name, c.dtype, c.shape) for c in FACET_COLUMNS])


@dataclass(frozen=True, eq=False)
class FacetSolutions:
    """Answers for some facets of one case.

    Attributes
    ----------
    rows : (n,) structured array of FACET_DTYPE
        NaN where a quantity does not exist (no feasible path).
    thrust_nodes_n : (sum of rows["thrust_nodes"], 3) float, N
        Thrust of the descent stage, constant over equal intervals of it, facet after facet in
        the order of ``rows``; in the inertial axes that coincide with the body axes at handover.
    """

    rows: NDArray[np.void]
    thrust_nodes_n: FloatArray

    @property
    def node_offsets(self) -> NDArray[np.int64]:
        """Where each facet's thrust nodes begin and end, (n + 1,) int."""
        return np.concatenate([[0], np.cumsum(self.rows["thrust_nodes"], dtype=np.int64)])

    def nodes_of(self, row: int) -> FloatArray:
        """Thrust nodes of the facet in one row, (k, 3) float, N."""
        offsets = self.node_offsets
        return self.thrust_nodes_n[offsets[row] : offsets[row + 1]]


def blank_rows(facets: NDArray[np.integer]) -> NDArray[np.void]:
    """Rows for the given facets: unresolved, with NaN in every float column."""
    rows = np.zeros(len(facets), dtype=FACET_DTYPE)
    for column in FACET_COLUMNS:
        if column.dtype == "f8":
            rows[column.name] = np.nan
    rows["facet"] = facets
    return rows


def join(parts: Sequence[FacetSolutions]) -> FacetSolutions:
    """Put parts together, rows in ascending facet order."""
    # parts are mostly runs of facets: those in order need no second copy, which would be the largest in a run
    ordered = sorted(parts, key=lambda p: int(p.rows["facet"][0]) if len(p.rows) else -1)
    rows = np.concatenate([p.rows for p in ordered])
    nodes = np.concatenate([p.thrust_nodes_n for p in ordered]).reshape(-1, 3)
    if (np.diff(rows["facet"].astype(np.int64)) >= 0).all():
        return FacetSolutions(rows, nodes)
    return take_rows(FacetSolutions(rows, nodes), np.argsort(rows["facet"], kind="stable"))


def take_rows(solutions: FacetSolutions, places: NDArray[np.int64]) -> FacetSolutions:
    """Take some rows, with their thrust nodes, in the order of their places."""
    offsets, rows = solutions.node_offsets, solutions.rows[places]
    lengths = rows["thrust_nodes"].astype(np.int64)
    # node k of a row that begins at b here and at a there comes from a + (k - b)
    shift = np.repeat(offsets[places] - (np.cumsum(lengths) - lengths), lengths)
    shift += np.arange(len(shift))
    return FacetSolutions(rows, solutions.thrust_nodes_n[shift].reshape(-1, 3))


def replace_rows(
    solutions: FacetSolutions, places: NDArray[np.int64], better: FacetSolutions
) -> FacetSolutions:
    """Put the rows of ``better`` at ``places``, adding up the iterations."""
    if len(places) == 0:
        return solutions
    source = np.arange(len(solutions.rows))
    source[places] = len(solutions.rows) + np.arange(len(places))
    rows = np.concatenate([solutions.rows, better.rows])
    nodes = np.concatenate([solutions.thrust_nodes_n, better.thrust_nodes_n])
    replaced = take_rows(FacetSolutions(rows, nodes), source)
    replaced.rows["iterations"][places] += solutions.rows["iterations"][places]
    return replaced

"""The reachable domain by section and expansion (Zhao 2022, sections 3.1 and 3.2).

The search asks a callable which facets are feasible and knows nothing about how that is decided; it asks
about every facet at most once. Facets are points: their centroids.

Where the paper is silent, this is what is done:

- The section plane holds the line from the centre of mass to the initial position (the axis). Its azimuth
  about the axis counts right-handed from the body's +z, or from +x where the axis is the spin axis. Only the
  half-plane on that side is walked, by the angle at the centre of mass from the axis (distance from the
  initial position, which orders the points of a round body alike, leaps to and fro on a waisted one). The
  walk always asks for what lies within 3h of the last feasible point, and ends once nothing there is
  feasible: whatever follows would be scattered. The boundary point is the farthest of the points kept.
- Scattered points: a run of feasible points that is cut off by more than 3h and shorter than that itself.
- Boundary points are adjacent when no other lies between them in azimuth about the axis. A gap is
  discontinuous when its two ends are farther apart than 3h, or when it takes more than half of the circle.
- Expansion by a step asks, of the points one h closer, those whose azimuth lies within a discontinuous gap
  (the paper's planes along the axis through the two ends). A gap in which the last step met no infeasible
  point is done: there is nothing to go around, though the walls of a notch may leave its ends 3h apart.
- The domain: facets that were asked keep their answer; of the others, those closer than the ring which are
  connected along shared edges to the feasible facet nearest to the initial position.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.errors import InputRefused

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Feasible = Callable[[IntArray], BoolArray]

CONTINUITY = 3.0
"""Adjacent points farther apart than this many h are not continuous (Zhao 2022, section 3.2)."""


@dataclass(frozen=True, eq=False)
class SectionResult:
    """What section and expansion found.

    Attributes
    ----------
    section_facets : (P(d),) int
        Facets of the section that were asked, outwards.
    ring_facets : (P(r),) int
        Facets of the ring of radius `radius_m`.
    expansion_facets : (P(e),) int
        Facets that the expansions added, step after step.
    solved, reachable : (m,) bool
        Which facets were asked, and which of these are feasible.
    radius_m : float, m
        Distance r0 from the initial position to the boundary point of the section; NaN where there is none.
    expansions : int
        Steps of expansion, the paper's n.
    boundary_facets : (k,) int
        Feasible facets of ring and expansions, by azimuth about the axis.
    domain : (m,) bool
        The reachable domain.
    closed : bool
        Whether the boundary became continuous.
    message : str
    """

    section_facets: IntArray
    ring_facets: IntArray
    expansion_facets: IntArray
    solved: BoolArray
    reachable: BoolArray
    radius_m: float
    expansions: int
    boundary_facets: IntArray
    domain: BoolArray
    closed: bool
    message: str

    @property
    def solves(self) -> int:
        """Number of facets asked, the paper's N (a facet of both section and ring counts once)."""
        return int(self.solved.sum())

    @property
    def ratio(self) -> float:
        """The share N / N_f of the facets that were asked."""
        return self.solves / len(self.solved)


def section_and_expansion(
    centroids_m: FloatArray,
    neighbours: IntArray,
    initial_position_m: ArrayLike,
    h_m: float,
    azimuth_deg: float,
    feasible: Feasible,
) -> SectionResult:
    """Find the boundary of the reachable domain, and the domain within, from few solved facets.

    Parameters
    ----------
    centroids_m : (m, 3) float, m, body frame about the centre of mass
        Landing points.
    neighbours : (m, 3) int
        Facets across the edges of each facet.
    initial_position_m : (3,) float, m, body frame about the centre of mass
        Where the descent starts.
    h_m : float, m
        Height of the surface triangles: width of section and ring, and step of the expansion.
    azimuth_deg : float, degree
        Azimuth of the section's half-plane about the axis, from the body's +z (or +x, see above).
    feasible : callable
        ``feasible(facets)`` with (k,) int tells which of these facets can be landed on, (k,) bool.

    Returns
    -------
    SectionResult

    Raises
    ------
    InputRefused
        The step or the initial position makes no section.
    """
    view = _view(centroids_m, initial_position_m, h_m, azimuth_deg)
    verdicts = _Verdicts(feasible, len(centroids_m))
    section, edge = _walk(view, verdicts)
    if edge is None:
        nothing = np.zeros(0, dtype=np.int64)
        domain = verdicts.reachable.copy()
        message = "no feasible facet in the section"
        return _result(view, verdicts, [section, nothing, nothing], np.nan, 0, domain, False, message)

    radius = float(view.range_m[edge])
    step = np.rint((radius - view.range_m) / h_m).astype(np.int64)  # 0 in the ring, k after k expansions
    ring = np.flatnonzero(step == 0)
    verdicts.ask(ring)
    added, last, expansions = [np.zeros(0, dtype=np.int64)], ring, 0
    gaps = _open_gaps(view, _boundary(view, verdicts, [ring]), last, verdicts)
    while len(gaps) and expansions < step.max():
        expansions += 1
        level = np.flatnonzero(step == expansions)
        last = level[_within(view, level, gaps).any(axis=1)]
        added.append(last[~verdicts.solved[last]])
        verdicts.ask(last)
        gaps = _open_gaps(view, _boundary(view, verdicts, [ring, *added]), last, verdicts)
    domain = _inside(view, neighbours, verdicts, step > 0)
    message = "boundary continuous" if not len(gaps) else f"{len(gaps)} gaps of the boundary never closed"
    parts = [section, ring, np.concatenate(added)]
    return _result(view, verdicts, parts, radius, expansions, domain, not len(gaps), message)


class _Verdicts:
    """What has been asked so far."""

    def __init__(self, feasible: Feasible, count: int) -> None:
        self._feasible = feasible
        self.solved = np.zeros(count, dtype=bool)
        self.reachable = np.zeros(count, dtype=bool)

    def ask(self, facets: IntArray) -> BoolArray:
        """Whether each facet is feasible, asking only for those not yet known."""
        new = facets[~self.solved[facets]]
        if len(new):
            self.reachable[new] = self._feasible(new)
            self.solved[new] = True
        return self.reachable[facets]


class _View(NamedTuple):
    """The landing points as seen along the axis from the initial position."""

    points: FloatArray  # (m, 3), m
    range_m: FloatArray  # (m,), m, distance from the initial position
    azimuth: FloatArray  # (m,), rad, about the axis, from the section's half-plane
    line: IntArray  # facets of the section's half-plane, outwards
    reach_m: float  # 3 h


def _view(points: FloatArray, initial_position_m: ArrayLike, h_m: float, azimuth_deg: float) -> _View:
    start = np.asarray(initial_position_m, dtype=np.float64)
    distance = float(np.linalg.norm(start))
    if not (h_m > 0.0 and distance > 0.0 and np.isfinite([h_m, distance, azimuth_deg]).all()):
        raise InputRefused(
            f"no section with h = {h_m} m, azimuth {azimuth_deg} degrees, initial position {start} m",
            fix="h and the distance from the centre of mass must be positive and finite",
        )
    axis = start / distance
    on_spin_axis = np.hypot(axis[0], axis[1]) < 1e-9
    reference = np.array([1.0, 0.0, 0.0]) if on_spin_axis else np.array([0.0, 0.0, 1.0])
    reference -= axis * (axis @ reference)
    reference /= np.linalg.norm(reference)
    turn = np.deg2rad(azimuth_deg)
    outward = np.cos(turn) * reference + np.sin(turn) * np.cross(axis, reference)
    across, along = points @ np.cross(axis, outward), points @ outward
    range_m = np.linalg.norm(points - start, axis=1)
    line = np.flatnonzero((np.abs(across) <= 0.5 * h_m) & (along > -0.5 * h_m))
    line = line[np.argsort(np.arctan2(np.abs(along), points @ axis)[line], kind="stable")]
    return _View(points, range_m, np.arctan2(across, along), line, CONTINUITY * h_m)


def _walk(view: _View, verdicts: _Verdicts) -> tuple[IntArray, int | None]:
    """Walk the section outwards: the facets that were asked, and the boundary point if there is one."""
    line, points = view.line, view.points
    runs: list[list[int]] = [[]]
    at = 0
    while at < len(line):
        run = runs[-1]
        anchor = points[run[-1] if run else line[at]]
        near = np.linalg.norm(points[line[at:]] - anchor, axis=1) <= view.reach_m
        batch = line[at:] if near.all() else line[at : at + int(np.argmin(near))]
        found = batch[verdicts.ask(batch)]
        at += len(batch)
        if len(found):
            run.extend(found.tolist())
        elif run:
            if _is_long(run, view):
                break
            runs.append([])
    candidates = [run for run in runs if run and _is_long(run, view)]
    candidates = candidates or sorted(filter(None, runs), key=len, reverse=True)
    farthest = max(candidates[0], key=lambda facet: view.range_m[facet]) if candidates else None
    return line[:at], farthest


def _is_long(run: list[int], view: _View) -> bool:
    return bool(np.linalg.norm(view.points[run[-1]] - view.points[run[0]]) > view.reach_m)


def _boundary(view: _View, verdicts: _Verdicts, parts: list[IntArray]) -> IntArray:
    """Feasible facets of ring and expansions by azimuth, each once."""
    facets = np.concatenate(parts)
    facets = np.unique(facets[verdicts.reachable[facets]])
    return facets[np.argsort(view.azimuth[facets], kind="stable")]


def _open_gaps(view: _View, boundary: IntArray, last: IntArray, verdicts: _Verdicts) -> FloatArray:
    """Azimuth at which each gap still to be expanded begins, and its width, (g, 2), rad.

    `last` are the facets of the last step: a gap without an infeasible one among them is done.
    """
    following = np.roll(boundary, -1)
    begin = view.azimuth[boundary]
    width = (view.azimuth[following] - begin) % (2.0 * np.pi)
    if len(boundary) == 1:
        width[:] = 2.0 * np.pi
    apart = np.linalg.norm(view.points[following] - view.points[boundary], axis=1)
    discontinuous = (apart > view.reach_m) | (width > np.pi)
    gaps = np.stack([begin, width], axis=1)[discontinuous]
    infeasible = last[~verdicts.reachable[last]]
    return gaps[_within(view, infeasible, gaps).any(axis=0)]


def _within(view: _View, facets: IntArray, gaps: FloatArray) -> BoolArray:
    """Whether the azimuth of each facet lies inside each gap, (k, g) bool."""
    ahead = (view.azimuth[facets][:, None] - gaps[:, 0]) % (2.0 * np.pi)
    return (ahead > 0.0) & (ahead < gaps[:, 1])


def _inside(view: _View, neighbours: IntArray, verdicts: _Verdicts, closer: BoolArray) -> BoolArray:
    """Fill the domain from the feasible facet nearest to the start, along shared edges."""
    passable = np.where(verdicts.solved, verdicts.reachable, closer)
    filled = np.zeros(len(passable), dtype=bool)
    feasible = np.flatnonzero(verdicts.reachable)
    front = feasible[[np.argmin(view.range_m[feasible])]]
    while len(front):
        filled[front] = True
        around = np.unique(neighbours[front])
        front = around[passable[around] & ~filled[around]]
    return filled | verdicts.reachable


def _result(
    view: _View,
    verdicts: _Verdicts,
    parts: list[IntArray],
    radius_m: float,
    expansions: int,
    domain: BoolArray,
    closed: bool,
    message: str,
) -> SectionResult:
    section, ring, expansion = parts
    return SectionResult(
        section_facets=section,
        ring_facets=ring,
        expansion_facets=expansion,
        solved=verdicts.solved,
        reachable=verdicts.reachable,
        radius_m=radius_m,
        expansions=expansions,
        boundary_facets=_boundary(view, verdicts, [ring, expansion]),
        domain=domain,
        closed=closed,
        message=message,
    )

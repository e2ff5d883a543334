"""Clusters of landmarks, and the side of the nominal they steer to (Shen 2026, sections 2.1 and 2.2)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.observe.observed import Clustering, Path
from landing_cli.observe.records import ObserveCase, Side, SteeringOptions

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_RESTARTS = 20
_SEED = 0  # of the restarts: the same landmarks give the same clusters
_NO_ERROR = 1e-20  # of the first error: as many clusters as places, which tells nothing
_SHORTEST_SHARE = 1e-9  # of the nominal's length: shorter segments have no direction


def cluster(case: ObserveCase, nominal: Path, options: SteeringOptions) -> Clustering:
    """Cluster the landmarks in the site's x-y plane and choose the control points.

    Parameters
    ----------
    case : ObserveCase
        Its landmarks and frame.
    nominal : Path
        Whose projection parts the plane.
    options : SteeringOptions
        k and the side, where they are given.

    Returns
    -------
    Clustering

    Raises
    ------
    InputRefused
        More clusters are asked for than there are landmarks, or no centre lies on the side that was asked.
    """
    points = np.ascontiguousarray(case.frame.to_site(case.landmarks.position_m)[:, :2])
    places = len(np.unique(points, axis=0))
    if options.clusters is not None and options.clusters > places:
        raise InputRefused(
            f"{options.clusters} clusters of {places} landmarks",
            where="steering.clusters",
            fix="ask for fewer",
        )
    tried = range(1, max(min(options.clusters_max, places), options.clusters or 1) + 1)
    found = [k_means(points, k) for k in tried]
    sse = np.array([errors for _, _, errors in found])
    k = options.clusters or elbow(sse[: options.clusters_max])
    center, label, _ = found[k - 1]
    track = projected(case.frame.to_site(nominal.position_m)[:, :2])
    side, along = side_and_way(track, center)
    steered_to, reason = _chosen_side(side, label, options.side)
    chosen = np.flatnonzero(side == _SIGN[steered_to])
    if not len(chosen):
        raise InputRefused(
            f"no centre lies on the {steered_to} of the unsteered path",
            where="steering.side",
            fix="leave the side out, or take the other one",
        )
    control = center[chosen[np.argsort(along[chosen], kind="stable")]]
    how: Literal["elbow", "given"] = "elbow" if options.clusters is None else "given"
    return Clustering(label, center, sse, how, side, steered_to, reason, control)


_SIGN: dict[Side, int] = {"left": 1, "right": -1}


def k_means(points_m: FloatArray, k: int) -> tuple[FloatArray, IntArray, float]:
    """Part points into k clusters (eqs 5, 6).

    Parameters
    ----------
    points_m : (n, 2) float, m
        At least k different ones.
    k : int
        Clusters.

    Returns
    -------
    (k, 2) float, m
        Centres, sorted along x.
    (n,) int
        Cluster of each point.
    float, m2
        I_SSE: the sum of squared distances to the centres; the least of 20 restarts by k-means++ (Arthur and
        Vassilvitskii, SODA 2007), for one start often ends in a worse partition.
    """
    rng = np.random.default_rng(_SEED)
    starts = [_spread_seeds(points_m, k, rng) for _ in range(_RESTARTS if k > 1 else 1)]
    ended = [part for start in starts if (part := _lloyd(points_m, start)) is not None]
    errors, center, label = min(ended, key=lambda part: part[0])
    order = np.lexsort((center[:, 1], center[:, 0]))
    return center[order], np.argsort(order)[label], errors


def elbow(sse_m2: FloatArray) -> int:
    """Find the number of clusters at the elbow of the error's curve.

    Parameters
    ----------
    sse_m2 : (q,) float, m2
        I_SSE of 1 to q clusters.

    Returns
    -------
    int
        The k at which log I_SSE lies farthest below the chord from its first to its last point; 1 for a curve
        without a bend. The paper reads the elbow off a plot of I_SSE itself. There the first drop outweighs
        the rest: of 60 random fields of three clusters that curve's chord finds three in 36, its largest
        second difference in 9, the logarithm's chord in 57; of 30 fields of four, in 1, and 27.
    """
    curve = np.log(sse_m2[sse_m2 > _NO_ERROR * sse_m2[0]])
    if len(curve) < 3 or curve[0] <= curve[-1]:
        return 1
    across = np.linspace(0.0, 1.0, len(curve))
    down = (curve - curve[-1]) / (curve[0] - curve[-1])
    return int(np.argmax(1.0 - across - down)) + 1


def projected(position_m: FloatArray) -> FloatArray:
    """Corners of a path's projection, (s, 2) float, m, without steps too short to have a direction.

    Parameters
    ----------
    position_m : (k, 2) float, m
        Samples in the order of flight.

    Returns
    -------
    (s, 2) float, m
        At least two corners.

    Raises
    ------
    InputRefused
        The path stands still in the plane: it has no sides.
    """
    length = float(np.linalg.norm(np.diff(position_m, axis=0), axis=1).sum())
    kept = [position_m[0]]
    for point in position_m[1:]:
        if np.linalg.norm(point - kept[-1]) > _SHORTEST_SHARE * length:
            kept.append(point)
    if len(kept) < 2:
        raise InputRefused(
            "the unsteered path is a vertical line in the site frame and has no sides",
            where="initial_state",
            fix="give control_points_m, or begin beside the site",
        )
    return np.array(kept)


def side_and_way(track_m: FloatArray, points_m: FloatArray) -> tuple[IntArray, FloatArray]:
    """On which side of a track points lie, and how far along it.

    Parameters
    ----------
    track_m : (s, 2) float, m
        Corners in the order of flight.
    points_m : (k, 2) float, m
        The points.

    Returns
    -------
    (k,) int
        +1 left of the nearest segment or on it, -1 right. Where a corner is nearest, the mean of its two
        directions decides, for its segments may disagree; beyond the ends, the end segments are produced.
    (k,) float, m
        Length along the track to the nearest point, or along the produced ends.
    """
    steps = np.diff(track_m, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    unit = steps / lengths[:, None]
    begins = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    offsets = points_m[:, None] - track_m[:-1]
    way = np.einsum("ksi,si->ks", offsets, unit)
    share = np.clip(way / lengths, 0.0, 1.0)[:, :, None]
    foot = (1.0 - share) * track_m[:-1] + share * track_m[1:]  # a corner is the same point for both segments
    nearest = np.argmin(np.linalg.norm(points_m[:, None] - foot, axis=2), axis=1)
    here, last = way[np.arange(len(points_m)), nearest], len(steps) - 1
    at_corner = (here >= lengths[nearest]) & (nearest < last)
    direction = unit[nearest] + np.where(at_corner[:, None], unit[np.minimum(nearest + 1, last)], 0.0)
    away = points_m - track_m[nearest]
    across = direction[:, 0] * away[:, 1] - direction[:, 1] * away[:, 0]
    here = np.where(at_corner, lengths[nearest], here)
    return np.where(across >= 0.0, 1, -1).astype(np.int64), begins[nearest] + here


def _lloyd(points: FloatArray, start: FloatArray) -> tuple[float, FloatArray, IntArray] | None:
    """Move centres until they rest: errors, centres, labels; None where a cluster loses all its points."""
    from scipy.cluster.vq import kmeans, vq

    center, _ = kmeans(points, start, thresh=0.0)
    if len(center) < len(start):
        return None
    label = vq(points, center)[0].astype(np.int64)
    return float(((points - center[label]) ** 2).sum()), center, label


def _spread_seeds(points: FloatArray, k: int, rng: np.random.Generator) -> FloatArray:
    """Take k points as first centres, each drawn by its squared distance to those before it."""
    chosen = [points[rng.integers(len(points))]]
    squares = np.full(len(points), np.inf)
    for _ in range(1, k):
        squares = np.minimum(squares, ((points - chosen[-1]) ** 2).sum(axis=1))
        chosen.append(points[rng.choice(len(points), p=squares / squares.sum())])
    return np.array(chosen)


def _chosen_side(
    side: IntArray, label: IntArray, given: Side | None
) -> tuple[Side, Literal["more_centers", "given", "more_landmarks"]]:
    """The side that is asked, or the one with more centres, or among equals with more landmarks."""
    if given is not None:
        return given, "given"
    centers = int(side.sum())
    if centers:
        return ("left" if centers > 0 else "right"), "more_centers"
    return ("left" if int(side[label].sum()) >= 0 else "right"), "more_landmarks"

"""The paper's paths and the most informative ones at no more energy, side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.observe.clusters import cluster
from landing_cli.observe.information import Candidate, best_spline, flown
from landing_cli.observe.information_program import SplineFlight, knots_of, spline_flight
from landing_cli.observe.nominal import nominal_path
from landing_cli.observe.observed import ObservedPath, Path
from landing_cli.observe.records import ObserveCase, SteeringOptions
from landing_cli.observe.tasks import observed
from landing_cli.observe.transcription import least_energy_path
from landing_cli.observe.waypoints import waypoints_of

FloatArray = NDArray[np.float64]

WEIGHTS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
"""The front is laid out with these weights, then refined about each energy that is asked for."""

_REFINEMENTS = 2
_AIM = 0.98  # of the energy beyond the least that is asked for, so that the answer lies within


@dataclass(frozen=True, eq=False)
class Front:
    """Splines that trade control energy for navigation.

    Attributes
    ----------
    flight : SplineFlight
    least : Path
        The least-energy path.
    points : dict
        By weight; more are added where the front is refined.
    """

    flight: SplineFlight
    least: Path
    points: dict[float, Candidate]

    def within(self, energy_m2_s3: float) -> tuple[Path, float]:
        """Fly the point of least sigma within an energy, m2/s3; the least path and weight 0 if none is."""
        usable = [
            (point.sigma_m, weight)
            for weight, point in self.points.items()
            if point.energy_m2_s3 <= energy_m2_s3 and point.solution.status == "converged"
        ]
        if not usable:
            return self.least, 0.0
        weight = min(usable)[1]
        point = self.points[weight]
        return flown(self.flight, point, self.least, point.solution.rounds), weight

    def energy_for(self, sigma_m: float) -> float:
        """Least J, m2/s3, of the points whose mean position sigma is no larger, m; infinite if none is."""
        usable = [point.energy_m2_s3 for point in self.points.values() if point.sigma_m <= sigma_m]
        return min(usable, default=math.inf)


@dataclass(frozen=True, eq=False)
class EqualEnergy:
    """A path of the paper's method, and the most informative one that spends no more.

    Attributes
    ----------
    waypoints : int
        m of the paper's path.
    paper : ObservedPath
    informed : ObservedPath
        Of the front at no more than the paper's J; the least-energy path where no point of the front is.
    weight : float
        lambda of that point; 0 where there is none.
    energy_for_sigma_m2_s3 : float, m2/s3
        Least J of the front's points that know the position no worse than the paper's path; infinite if none.
    """

    waypoints: int
    paper: ObservedPath
    informed: ObservedPath
    weight: float
    energy_for_sigma_m2_s3: float

    @property
    def sigma_ratio(self) -> float:
        """Mean position sigma of the informed path over the paper's."""
        return self.informed.sigma.mean_m / self.paper.sigma.mean_m


def compare_at_equal_energy(
    case: ObserveCase, options: SteeringOptions, counts: Sequence[int], knots: int
) -> tuple[ObservedPath, list[EqualEnergy]]:
    """Steer by the paper's method with several numbers of waypoints, and ask the front at each energy.

    Parameters
    ----------
    case : ObserveCase
        What is asked.
    options : SteeringOptions
        Of the paper's method; its number of waypoints is not used.
    counts : sequence of int
        Numbers of waypoints, positive.
    knots : int
        Inner spline knots of the informed paths.

    Returns
    -------
    least : ObservedPath
        The least-energy path without waypoints.
    compared : list of EqualEnergy
        One for each count.
    """
    nominal = nominal_path(case)
    control = cluster(case, nominal, options).control_points_m
    least = least_energy_path(case, nominal.tof_s, None, options.nodes)
    papers = []
    for count in counts:
        way = SteeringOptions(waypoints=count, timing=options.timing, nodes=options.nodes)
        waypoints = waypoints_of(case, control, nominal.tof_s, way)
        papers.append(least_energy_path(case, nominal.tof_s, waypoints, options.nodes))
    energies = [path.performance_index_m2_s3 for path in papers]
    front = front_about(case, least, energies, knots, papers[-1:])
    compared = []
    for count, path in zip(counts, papers, strict=True):
        paper = observed(case, path)
        informed, weight = front.within(path.performance_index_m2_s3)
        for_sigma = front.energy_for(paper.sigma.mean_m)
        compared.append(EqualEnergy(count, paper, observed(case, informed), weight, for_sigma))
    return observed(case, least), compared


def front_about(
    case: ObserveCase,
    least: Path,
    energies_m2_s3: Sequence[float],
    knots: int,
    others: Sequence[Path] = (),
) -> Front:
    """Lay out the front of control energy against navigation, finely about several energies.

    Parameters
    ----------
    case : ObserveCase
        What is asked.
    least : Path
        The least-energy path.
    energies_m2_s3 : sequence of float, m2/s3
        Where the front is wanted.
    knots : int
        Inner spline knots.
    others : sequence of Path, optional
        More paths to start from.

    Returns
    -------
    Front
        Its weights end with the first that spends more than every energy.
    """
    flight = spline_flight(case, least.tof_s, knots)
    starts = [knots_of(flight, path) for path in (least, *others)]
    front = Front(flight, least, {})
    for weight in WEIGHTS:
        _add_point(front, starts, weight)
        if front.points[weight].energy_m2_s3 > max(energies_m2_s3):
            break
    for energy in energies_m2_s3:
        for _ in range(_REFINEMENTS):
            between = _weight_between(front, energy)
            if between is None:
                break
            _add_point(front, starts, between)
    return front


def _add_point(front: Front, starts: Sequence[FloatArray], weight: float) -> None:
    """Add one point, searched from its lighter neighbour too."""
    lighter = [front.points[w].knots_m for w in sorted(front.points) if w < weight][-1:]
    front.points[weight] = best_spline(front.flight, [*starts, *lighter], front.least, weight)[0]


def _weight_between(front: Front, energy: float) -> float | None:
    """Weight at which the front should come to an energy, by its neighbours; None where one is missing."""
    weights, unit = sorted(front.points), front.least.performance_index_m2_s3
    excess = {w: max(front.points[w].energy_m2_s3 / unit - 1.0, 1e-9) for w in weights}
    wanted = _AIM * (energy / unit - 1.0)
    within = [w for w in weights if excess[w] <= wanted]
    beyond = [w for w in weights if excess[w] > wanted]
    if not within or not beyond or max(within) >= min(beyond):
        return None
    low, high = max(within), min(beyond)
    share = math.log(wanted / excess[low]) / math.log(excess[high] / excess[low])
    share = min(max(share, 0.1), 0.9)
    return float(low * (high / low) ** share)

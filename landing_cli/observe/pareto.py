"""The paper's paths and the most informative ones at no more energy, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.observe.clusters import cluster
from landing_cli.observe.information import Candidate, best_spline, flown
from landing_cli.observe.information_program import SplineFlight, knots_of, spline_flight
from landing_cli.observe.nominal import nominal_path
from landing_cli.observe.records import ObserveCase, ObservedPath, Path, SteeringOptions
from landing_cli.observe.tasks import observed
from landing_cli.observe.transcription import least_energy_path
from landing_cli.observe.waypoints import waypoints_of

FloatArray = NDArray[np.float64]

WEIGHTS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
"""The front is laid out with these weights, then refined about each energy that is asked for."""

_BISECTIONS = 4  # of the weight between two points of the front: a quarter of a decade to a thirtieth


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
    """

    waypoints: int
    paper: ObservedPath
    informed: ObservedPath
    weight: float

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
    found = informed_within(case, least, energies, knots, papers)
    compared = [
        EqualEnergy(count, observed(case, paper), observed(case, path), weight)
        for count, paper, (path, weight) in zip(counts, papers, found, strict=True)
    ]
    return observed(case, least), compared


def informed_within(
    case: ObserveCase,
    least: Path,
    energies_m2_s3: Sequence[float],
    knots: int,
    others: Sequence[Path] = (),
) -> list[tuple[Path, float]]:
    """Find the most informative path within each of several energies.

    Parameters
    ----------
    case : ObserveCase
        What is asked.
    least : Path
        The least-energy path.
    energies_m2_s3 : sequence of float, m2/s3
        Bounds of J.
    knots : int
        Inner spline knots.
    others : sequence of Path, optional
        More paths to start from.

    Returns
    -------
    list of (Path, float)
        The path within each energy and its weight; the least-energy path and 0 where none is found.
    """
    flight = spline_flight(case, least.tof_s, knots)
    starts = [knots_of(flight, path) for path in (least, *others)]
    front: dict[float, Candidate] = {}
    for weight in WEIGHTS:
        front[weight] = _with_weight(flight, starts, least, weight, front)
        if front[weight].energy_m2_s3 > max(energies_m2_s3):
            break
    answers = []
    for bound in energies_m2_s3:
        for _ in range(_BISECTIONS):
            within = [w for w in sorted(front) if front[w].energy_m2_s3 <= bound]
            beyond = [w for w in sorted(front) if front[w].energy_m2_s3 > bound]
            if not within or not beyond or max(within) > min(beyond):
                break
            middle = float(np.sqrt(max(within) * min(beyond)))
            front[middle] = _with_weight(flight, starts, least, middle, front)
        answers.append(_best_within(flight, front, bound, least))
    return answers


def _with_weight(
    flight: SplineFlight,
    starts: Sequence[FloatArray],
    least: Path,
    weight: float,
    front: dict[float, Candidate],
) -> Candidate:
    """One point of the front, searched from its lighter neighbour too."""
    lighter = [front[w].knots_m for w in sorted(front) if w < weight][-1:]
    return best_spline(flight, [*starts, *lighter], least, weight)[0]


def _best_within(
    flight: SplineFlight, front: dict[float, Candidate], bound: float, least: Path
) -> tuple[Path, float]:
    usable = [
        (one.sigma_m, weight)
        for weight, one in front.items()
        if one.energy_m2_s3 <= bound and one.solution.status == "converged"
    ]
    if not usable:
        return least, 0.0
    weight = min(usable)[1]
    return flown(flight, front[weight], least, front[weight].solution.rounds), weight

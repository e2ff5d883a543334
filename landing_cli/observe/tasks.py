"""What `plan observe` computes: the landing steered in several ways, solved in any order and place."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from landing_cli.observe.covariance import sigma_along
from landing_cli.observe.observed import Clustering, Observation, ObservedPath, Path, Waypoints
from landing_cli.observe.path_samples import positions_at
from landing_cli.observe.records import InformationOptions, ObserveCase, Parameter, SteeringOptions
from landing_cli.observe.transcription import least_energy_path
from landing_cli.observe.visibility import seen_along, unseen_reason
from landing_cli.observe.waypoints import waypoints_of


@dataclass(frozen=True)
class ObserveTask:
    """One way to steer.

    Attributes
    ----------
    name : str
        ``waypoints_<m>`` or ``information_<weight>``.
    options : SteeringOptions or InformationOptions
        Whose kind is the objective.
    """

    name: str
    options: SteeringOptions | InformationOptions


@dataclass(frozen=True, eq=False)
class Ground:
    """What all tasks of a run start from.

    Attributes
    ----------
    case : ObserveCase
        What was asked, in the body's own gravity: what a path sees is found out in it.
    solver_case : ObserveCase
        The same in the gravity that paths are planned in, which may be fitted to it.
    gravity : mapping
        What is to be said of that gravity, JSON-ready.
    nominal : ObservedPath
        The unsteered path; its time of flight is everybody's.
    clustering : Clustering
        Of the landmarks.
    control_points_m : (c, 2) nested tuple, m, site frame x, y
        Inner control points of the waypoints' curve.
    ways : tuple of SteeringOptions
        The paper's method for every number of waypoints that was asked for; also where the path that sees
        best is searched from.
    """

    case: ObserveCase
    solver_case: ObserveCase
    gravity: Mapping[str, Parameter]
    nominal: ObservedPath
    clustering: Clustering
    control_points_m: tuple[tuple[float, float], ...]
    ways: tuple[SteeringOptions, ...]


@dataclass(frozen=True, eq=False)
class SolvedTask:
    """A task's answer.

    Attributes
    ----------
    index : int
        Of the task.
    observation : Observation
    cpu_s : float
        CPU time of finding the path, compiled kernels loaded.
    """

    index: int
    observation: Observation
    cpu_s: float


def observed(case: ObserveCase, path: Path) -> ObservedPath:
    """Find out what a path sees, and how well it knows where it is.

    Parameters
    ----------
    case : ObserveCase
        What was asked.
    path : Path
        A flown one.

    Returns
    -------
    ObservedPath
    """
    seen = seen_along(case, path)
    return ObservedPath(path, seen, sigma_along(case, path, seen))


def solve_tasks(ground: Ground, tasks: Sequence[ObserveTask], indices: Sequence[int]) -> list[SolvedTask]:
    """Solve some tasks.

    Parameters
    ----------
    ground : Ground
        What they start from.
    tasks : sequence of ObserveTask
        All of them.
    indices : sequence of int
        Which to solve.

    Returns
    -------
    list of SolvedTask
    """
    return [_timed(ground, index, tasks[index]) for index in indices]


def solve_task(ground: Ground, task: ObserveTask) -> Observation:
    """Steer the landing in one way.

    Parameters
    ----------
    ground : Ground
        What it starts from.
    task : ObserveTask
        The way.

    Returns
    -------
    Observation
    """
    case, tof_s = ground.solver_case, ground.nominal.path.tof_s
    parameters: dict[str, Parameter] = dict(ground.gravity)
    waypoints = None
    if isinstance(task.options, SteeringOptions):
        waypoints = _waypoints(ground, task.options)
        path = least_energy_path(case, tof_s, waypoints, task.options.nodes)
    else:
        path, least = _informed(ground, task.options)
        parameters |= {"weight": task.options.weight, "knots": task.options.knots}
        parameters["performance_index_ratio"] = path.performance_index_m2_s3 / least
    steered = observed(ground.case, path)
    if not steered.seen.distinct:
        where = positions_at(path, steered.seen.t_s)
        parameters["unseen_because"] = unseen_reason(ground.case, steered.seen, where)
    return Observation(
        objective="energy" if isinstance(task.options, SteeringOptions) else "information",
        nominal=ground.nominal,
        clustering=ground.clustering,
        waypoints=waypoints,
        steered=steered,
        parameters=parameters,
    )


def _waypoints(ground: Ground, way: SteeringOptions) -> Waypoints | None:
    if not way.waypoints:
        return None
    return waypoints_of(ground.solver_case, ground.control_points_m, ground.nominal.path.tof_s, way)


def _informed(ground: Ground, options: InformationOptions) -> tuple[Path, float]:
    """Return the path that sees best, searched from the paper's paths too, and the least J."""
    from landing_cli.observe.information import most_informative_path

    case, tof_s = ground.solver_case, ground.nominal.path.tof_s
    nodes = ground.ways[0].nodes
    least = least_energy_path(case, tof_s, None, nodes)
    others = [
        least_energy_path(case, tof_s, _waypoints(ground, way), nodes) for way in ground.ways if way.waypoints
    ]
    return most_informative_path(case, least, options, others), least.performance_index_m2_s3


def _timed(ground: Ground, index: int, task: ObserveTask) -> SolvedTask:
    began = time.thread_time()
    observation = solve_task(ground, task)
    return SolvedTask(index, observation, time.thread_time() - began)

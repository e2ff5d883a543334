"""`plan observe`, step by step: case, nominal, clusters, steered paths, what they see, the file."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from landing_cli import __version__
from landing_cli.body.ray_cast import obstructed_into
from landing_cli.compile_cache import is_cached
from landing_cli.errors import InputRefused
from landing_cli.observe.cases import observe_case
from landing_cli.observe.clusters import cluster
from landing_cli.observe.landmark_source import with_landmarks_hash
from landing_cli.observe.nominal import nominal_path
from landing_cli.observe.observed import Observation
from landing_cli.observe.records import InformationOptions, Objective, ObserveCase, Parameter, SteeringOptions
from landing_cli.observe.stored import (
    CPU_ATTRIBUTE,
    MISSION,
    ObservationEntry,
    ObserveRun,
    observation_from_arrays,
    observation_to_arrays,
    run_from_result,
    run_to_tree,
)
from landing_cli.observe.tasks import Ground, ObserveTask, SolvedTask, observed, solve_tasks
from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.results.identity import RunIdentity
from landing_cli.results.journal import Journal
from landing_cli.results.output import finish_output, open_output
from landing_cli.results.provenance import Stopwatch
from landing_cli.results.store import read
from landing_cli.scenario.build import build
from landing_cli.scenario.load import LoadedScenario
from landing_cli.scenario.messages import Problem, refusal
from landing_cli.scenario.schema_observe import ObserveSection
from landing_cli.scenario.sections import for_mission, observe_section
from landing_cli.scenario.show import to_yaml

FloatArray = NDArray[np.float64]

COMPILING = "compiling the kernels (once after an installation; about half a minute)"


@dataclass(frozen=True, eq=False)
class Request:
    """What `plan observe` is asked.

    Attributes
    ----------
    loaded : LoadedScenario
        With an ``observe`` section, and in it the hash of the landmarks' file.
    case : ObserveCase
    tasks : tuple of ObserveTask
        The ways to steer, in the order in which they are shown.
    shape_sha256 : str
    """

    loaded: LoadedScenario
    case: ObserveCase
    tasks: tuple[ObserveTask, ...]
    shape_sha256: str


@dataclass(frozen=True)
class RunOptions:
    """How a run is carried out."""

    plan: WorkPlan
    resume: bool = False
    force: bool = False


@dataclass(frozen=True)
class Outcome:
    """A run, whether its result was there already, and why observations were lost, by name."""

    run: ObserveRun
    up_to_date: bool
    lost: dict[str, str]


def request_of(loaded: LoadedScenario, say: Callable[[str], None] = lambda _: None) -> Request:
    """Make a request of a scenario file.

    Parameters
    ----------
    loaded : LoadedScenario
        The checked scenario, with what the command line says written into it.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    Request

    Raises
    ------
    InputRefused
        The scenario has no ``observe`` section, or contradicts its mesh or its landmarks.
    """
    observe_section(loaded)  # before the shape is read
    own = with_landmarks_hash(replace(loaded, scenario=for_mission(loaded.scenario, MISSION)))
    built = build(own, say)
    case = observe_case(own, built.asteroid, built.spacecraft)
    return Request(own, case, tasks_of(observe_section(own)), built.shape_sha256)


def tasks_of(section: ObserveSection) -> tuple[ObserveTask, ...]:
    """Return the ways to steer that a scenario asks for.

    Parameters
    ----------
    section : ObserveSection
        Its waypoints; under the information objective the weights first, and the paper's waypoints beside
        them for comparison.

    Returns
    -------
    tuple of ObserveTask
    """
    steered = [ObserveTask(f"waypoints_{way.waypoints}", way) for way in steering_of(section)]
    if section.objective == "energy":
        return tuple(steered)
    weights, knots = section.information.weight, section.information.knots
    informed = [ObserveTask(f"information_{w:.6g}", InformationOptions(w, knots)) for w in weights]
    return (*informed, *steered)


def steering_of(section: ObserveSection) -> tuple[SteeringOptions, ...]:
    """Return the paper's method for every number of waypoints that a scenario names.

    Parameters
    ----------
    section : ObserveSection
        Its ``steering``.

    Returns
    -------
    tuple of SteeringOptions
    """
    shared = section.steering.model_dump()
    return tuple(SteeringOptions(waypoints=m, **shared) for m in shared.pop("waypoints"))


def run(
    request: Request,
    output: Path,
    options: RunOptions,
    progress: Callable[[int, int], None],
    say: Callable[[str], None] = lambda _: None,
) -> Outcome:
    """Steer the landing in every way asked for and store what is found.

    Parameters
    ----------
    request : Request
        What was asked.
    output : Path
        Where the result goes.
    options : RunOptions
        Backend, resume, force.
    progress : callable
        Told (solved, total) observations.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    Outcome
        The run as stored.

    Raises
    ------
    LandingError
        The output is refused.
    """
    watch = Stopwatch()
    text = to_yaml(request.loaded.scenario)
    identity = RunIdentity("plan observe", text, request.shape_sha256, __version__, chunk_facets=1)
    journal = open_output(output, identity, resume=options.resume, force=options.force)
    if journal is None:
        return Outcome(run_from_result(read(output)), up_to_date=True, lost={})
    with journal:
        if not is_cached(obstructed_into):
            say(COMPILING)
        ground = ground_of(request)
        solved, lost = _solve(request, ground, journal, options, progress)
        found = ObserveRun(
            tuple(_entry(ground, task, solved.get(i), lost) for i, task in enumerate(request.tasks))
        )
        taken = {"jobs": options.plan.jobs, "backend": options.plan.backend, "resumed": int(options.resume)}
        times = np.array([entry.cpu_s for entry in found.cases])
        provenance = watch.provenance(**taken, **{CPU_ATTRIBUTE: times})
        finish_output(journal, run_to_tree(found), {"mission": MISSION}, provenance, complete=not lost)
    return Outcome(found, up_to_date=False, lost=lost)


def ground_of(request: Request) -> Ground:
    """Fly the unsteered path, and find the clusters and the side to steer to.

    Parameters
    ----------
    request : Request
        What was asked.

    Returns
    -------
    Ground

    Raises
    ------
    InputRefused
        The number of clusters or the side that was asked contradicts the landmarks.
    """
    section, case = observe_section(request.loaded), request.case
    solver_case, gravity = _solver_case(section, case)
    nominal = observed(case, nominal_path(solver_case))
    ways = steering_of(section)
    given = section.steering.control_points_m
    try:
        clustering = cluster(case, nominal.path, ways[0])
    except InputRefused as error:  # the options contradict the landmarks
        problem = Problem((MISSION, *error.where.split(".")), error.what, error.fix)
        raise refusal([problem], request.loaded.places, request.loaded.source) from error
    points = _pairs(clustering.control_points_m) if given is None else given
    return Ground(case, solver_case, gravity, nominal, clustering, points, ways)


def _solver_case(section: ObserveSection, case: ObserveCase) -> tuple[ObserveCase, dict[str, Parameter]]:
    """Return the case in the field that the solvers fly in, and what is to be said of that field."""
    if section.gravity != "interpolated":
        return case, {"gravity": case.asteroid.gravity.kind.name.lower()}
    from landing_cli.body.gravity.boxed import boxed_field
    from landing_cli.observe.gravity_box import box_of

    fitted = boxed_field(case.asteroid.gravity, box_of(case))
    told: dict[str, Parameter] = {
        "gravity": "interpolated",
        "gravity_error_relative": fitted.error,
        "gravity_pieces": fitted.pieces,
        "gravity_checked_points": fitted.checked_points,
    }
    return replace(case, asteroid=replace(case.asteroid, gravity=fitted.field)), told


def _pairs(points_m: FloatArray) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in points_m)


def _solve(
    request: Request,
    ground: Ground,
    journal: Journal,
    options: RunOptions,
    progress: Callable[[int, int], None],
) -> tuple[dict[int, SolvedTask], dict[str, str]]:
    """Solve the tasks one by one, each recorded as it comes; take over those that the journal holds."""
    tasks = request.tasks
    solved = {int(key): _recorded(ground, int(key), arrays) for key, arrays in journal.records.items()}
    progress(len(solved), len(tasks))
    left = [[index] for index in range(len(tasks)) if index not in solved]
    lost: dict[str, str] = {}
    with closing(run_chunks(partial(solve_tasks, ground, tasks), left, options.plan)) as answers:
        for _, answer in answers:
            if isinstance(answer, LostChunk):
                lost |= {tasks[index].name: answer.reason for index in answer.items}
                continue
            for item in answer:
                arrays = observation_to_arrays(item.observation, item.cpu_s)
                journal.append(str(item.index), arrays)
                solved[item.index] = _recorded(ground, item.index, arrays)
            progress(len(solved), len(tasks))
    return solved, lost


def _recorded(ground: Ground, index: int, arrays: dict[str, np.ndarray]) -> SolvedTask:
    observation, cpu_s = observation_from_arrays(arrays, ground.nominal, ground.clustering)
    return SolvedTask(index, observation, cpu_s)


def _entry(
    ground: Ground, task: ObserveTask, solved: SolvedTask | None, lost: dict[str, str]
) -> ObservationEntry:
    """Put a task and its answer together; one that was lost shows the unsteered path."""
    if solved is not None:
        return ObservationEntry(task.name, ground.case, solved.observation, solved.cpu_s)
    objective: Objective = "energy" if isinstance(task.options, SteeringOptions) else "information"
    reason = f"lost: {lost.get(task.name, 'not solved')}; the path is the unsteered one"
    path = replace(ground.nominal.path, status="unresolved", message=reason)
    steered = replace(ground.nominal, path=path)
    observation = Observation(objective, ground.nominal, ground.clustering, None, steered)
    return ObservationEntry(task.name, ground.case, observation, math.nan)

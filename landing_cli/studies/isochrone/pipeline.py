"""`reach isochrone`, step by step: the grid, the halvings of each change, intervals, the file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from landing_cli import __version__
from landing_cli.parallel import WorkPlan
from landing_cli.reach.cases import landing_cases
from landing_cli.reach.facet_work import CHUNK_FACETS, in_chunks
from landing_cli.reach.free_descent import survey
from landing_cli.reach.kernels import are_compiled, compile_parts
from landing_cli.reach.records import LandingCase
from landing_cli.results.identity import RunIdentity
from landing_cli.results.journal import Journal
from landing_cli.results.output import finish_output, open_output
from landing_cli.results.provenance import Stopwatch
from landing_cli.results.store import read
from landing_cli.scenario.build import Built, build
from landing_cli.scenario.load import LoadedScenario
from landing_cli.scenario.schema import Reach
from landing_cli.scenario.sections import fixed_stage_reach, for_mission, isochrone_section, reach_section
from landing_cli.scenario.show import to_yaml
from landing_cli.studies.isochrone.intervals import facet_numbers, intervals_of
from landing_cli.studies.isochrone.recorded import solve_recorded
from landing_cli.studies.isochrone.records import (
    SAMPLE_DTYPE,
    GridAnswers,
    IsochroneRun,
    Lost,
    Rows,
    StateResult,
)
from landing_cli.studies.isochrone.stored import MISSION, run_from_result, run_to_tree
from landing_cli.studies.isochrone.summary import summarise
from landing_cli.studies.isochrone.time_grid import TimeGrid, time_grid
from landing_cli.studies.isochrone.work import (
    Items,
    Study,
    ask,
    blank_samples,
    changes_of,
    halve_changes,
    solve_items,
    step_of,
)

COMMAND = "reach isochrone"
COMPILING = "compiling the kernels (once after an installation)"
COMPILING_FACETS = 8
ITEM_DTYPE = np.dtype([("item", "i8")])


@dataclass(frozen=True)
class RunOptions:
    """What a study is told beside its scenario."""

    plan: WorkPlan
    resume: bool = False
    force: bool = False


@dataclass(frozen=True)
class Outcome:
    """A study, and whether its result was there already."""

    run: IsochroneRun
    up_to_date: bool


def states_of(reach: Reach, built: Built) -> tuple[LandingCase, ...]:
    """Make one case an initial state, named like it, in the scenario's order."""
    first: dict[str, LandingCase] = {}
    for name, case in landing_cases(reach, built):
        first.setdefault(name, replace(case, name=name, margin=False))
    return tuple(first.values())


def grid_of(loaded: LoadedScenario, states: tuple[LandingCase, ...]) -> TimeGrid:
    """Lay out the times of flight that a scenario asks for."""
    asked = {tof_s for _, _, tof_s in reach_section(loaded).cases()}
    return time_grid(isochrone_section(loaded), states, asked)


def run(
    loaded: LoadedScenario,
    output: Path,
    options: RunOptions,
    progress: Callable[[int, int], None],
    say: Callable[[str], None] = lambda _: None,
) -> Outcome:
    """Find the times of flight at which each facet is reachable, from every initial state, and store them.

    Parameters
    ----------
    loaded : LoadedScenario
        The checked scenario.
    output : Path
        Where the result goes.
    options : RunOptions
        Backend, resume, force.
    progress : callable
        Told (solved, total) facets; the total grows by what the changes of verdict ask for.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    Outcome
        The study as stored.

    Raises
    ------
    LandingError
        The scenario contradicts its mesh, or the output is refused.
    """
    watch = Stopwatch()
    reach = fixed_stage_reach(loaded, COMMAND)
    built = build(loaded, say)
    states = states_of(reach, built)
    grid = grid_of(loaded, states)
    identity = RunIdentity(
        COMMAND, _asked(loaded), built.shape_sha256, __version__, chunk_facets=CHUNK_FACETS
    )
    journal = open_output(output, identity, resume=options.resume, force=options.force)
    if journal is None:
        return Outcome(run_from_result(read(output)), up_to_date=True)
    with journal:
        states = tuple(replace(case, tof_s=float(grid.tof_s[-1])) for case in states)
        study = _prepared(states, grid, say)
        found = _solve(study, journal, options.plan, progress)
        taken = {"jobs": options.plan.jobs, "backend": options.plan.backend, "resumed": int(options.resume)}
        finish_output(
            journal,
            run_to_tree(found),
            {"mission": MISSION},
            watch.provenance(**taken),
            complete=not found.lost_items,
        )
    return Outcome(found, up_to_date=False)


def _asked(loaded: LoadedScenario) -> str:
    """Everything in the scenario that decides the numbers, defaults included."""
    own = for_mission(loaded.scenario, "reach", "isochrone")
    return to_yaml(own.model_copy(update={"isochrone": isochrone_section(loaded)}))


def _prepared(states: tuple[LandingCase, ...], grid: TimeGrid, say: Callable[[str], None]) -> Study:
    """Survey what all cases share, and compile in the parent, so that no worker waits or compiles again."""
    compiled = are_compiled(states[0].descent)
    if not compiled:
        say(COMPILING)
        compile_parts(states[0])
    study = Study(states, grid, survey(states[0]))
    if not compiled:
        items = study.grid_items
        solve_items(study, items[:: max(1, len(items) // COMPILING_FACETS)])
    return study


def _solve(
    study: Study, journal: Journal, plan: WorkPlan, progress: Callable[[int, int], None]
) -> IsochroneRun:
    """Ask every facet at the grid's times, then halve every step in which a verdict changes."""
    done = 0
    total = len(study.grid_items)

    def told(more: int) -> None:
        nonlocal done
        done += more
        progress(done, max(total, done))

    chunks = [items.view(ITEM_DTYPE) for items in in_chunks(study.grid_items)]
    samples, lost = solve_recorded(journal, "grid", chunks, partial(ask, study), _itself, plan, told)
    samples = np.concatenate([samples, blank_samples(np.array(list(lost), dtype=np.int64))])
    samples = samples[np.argsort(samples["item"])]
    ends = samples[:0]
    if study.grid.halvings:
        # where an answer was lost, what it leads to is asked once it is there
        changes = [chunk[~_touched(study, chunk, lost)] for chunk in changes_of(study, samples)]
        total = done + study.grid.halvings * sum(map(len, changes))
        halve, owners = partial(halve_changes, study), partial(step_of, study)
        ends, gone = solve_recorded(journal, "ends", changes, halve, owners, plan, told)
        lost |= gone
    return IsochroneRun(
        tuple(_state_result(study, index, samples, ends, lost) for index in range(len(study.cases)))
    )


def _itself(items: Items) -> Items:
    return items


def _touched(study: Study, changes: Rows, lost: dict[int, str]) -> NDArray[np.bool_]:
    """Which steps begin or end with a lost answer."""
    begin = changes["item"]
    return np.isin(begin, list(lost)) | np.isin(begin + study.grid.parts * study.facets, list(lost))


def _state_result(study: Study, index: int, samples: Rows, ends: Rows, lost: dict[int, str]) -> StateResult:
    """Put together what was found for one initial state."""
    case, grid = study.cases[index], study.grid
    by_grid = samples.reshape(-1, len(grid.tof_s), study.facets)[index]
    every = np.concatenate([samples, ends])
    state, place, facet = study.parted(every["item"])
    own = state == index
    answers = GridAnswers(
        *(np.ascontiguousarray(by_grid[name]) for name in SAMPLE_DTYPE.names or () if name != "item")
    )
    intervals = intervals_of(grid, facet[own], place[own], every["verdict"][own])
    facets = facet_numbers(grid, answers, intervals)
    return StateResult(
        case,
        grid,
        answers,
        intervals,
        facets,
        summarise(case.asteroid.mesh, grid, facets, intervals),
        _lost_of(study, index, lost),
    )


def _lost_of(study: Study, index: int, lost: dict[int, str]) -> tuple[Lost, ...]:
    """The questions of one initial state that could not be answered."""
    items = np.array(sorted(lost), dtype=np.int64)  # of a step, its beginning
    state, place, facet = study.parted(items)
    tof_s = study.grid.times_s(place)
    own = np.flatnonzero(state == index).tolist()
    return tuple(Lost(int(facet[k]), float(tof_s[k]), lost[int(items[k])]) for k in own)

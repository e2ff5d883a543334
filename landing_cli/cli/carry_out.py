"""What every command that solves has in common: where work runs, progress, and what is said at the end."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

from landing_cli.cli import console, guard
from landing_cli.cli.options import Backend
from landing_cli.errors import NothingFeasible, PartialResult

if TYPE_CHECKING:
    from landing_cli.parallel.plan import WorkPlan


class Outcome(Protocol):
    """What a pipeline returns: a run, and whether its result was there already."""

    @property
    def up_to_date(self) -> bool:
        """Whether nothing had to be solved."""


Result = TypeVar("Result", bound=Outcome)


def work_plan(jobs: int | None, backend: Backend, scheduler: str | None) -> WorkPlan:
    """Say where work runs, and hold BLAS to one thread; to be called before numpy is imported.

    Parameters
    ----------
    jobs : int or None
        None: as many as there are processors for this process.
    backend : Backend
        As it was given on the command line.
    scheduler : str or None
        Address of a Dask scheduler, for that backend.

    Returns
    -------
    WorkPlan

    Raises
    ------
    UsageError
        If the three do not fit together.
    """
    from landing_cli.parallel.blas import pin_blas_threads
    from landing_cli.parallel.plan import WorkPlan

    plan = WorkPlan(
        jobs=len(os.sched_getaffinity(0)) if jobs is None else jobs,
        backend=backend.value,
        scheduler=scheduler,
    )
    pin_blas_threads()
    return plan


def carry_out(
    run: Callable[[Callable[[int, int], None]], Result],
    path: Path,
    voice: console.Console,
    unit: str,
    same: str = "scenario, shape and version",
) -> Result:
    """Run a pipeline with its progress, tell an interrupted user how to go on, and say what was written.

    Parameters
    ----------
    run : callable
        Solves and stores; takes what is told (done, total).
    path : Path
        Where the result goes.
    voice : Console
        Speaks on stderr.
    unit : str
        What is counted, in the plural.
    same : str
        What decides whether a result is up to date.

    Returns
    -------
    Outcome
        What the pipeline returned.
    """
    with voice.progress(unit) as progress:

        def told(done: int, total: int) -> None:
            if done:  # until then, while kernels compile say, there is nothing to continue
                guard.hint_on_interrupt(f"finished {unit} are kept: continue with --resume (output {path})")
            progress(done, total)

        outcome = run(told)
    guard.hint_on_interrupt("")
    say_written(outcome, path, voice, same)
    return outcome


def say_written(outcome: Outcome, path: Path, voice: console.Console, same: str) -> None:
    """Say that a result was written, or that it was there already.

    Parameters
    ----------
    outcome : Outcome
        Of the pipeline.
    path : Path
        Where the result is.
    voice : Console
        Speaks on stderr.
    same : str
        What decides whether a result is up to date.
    """
    if outcome.up_to_date:
        voice.say(f"{path} is up to date: same {same} (--force solves again)")
    else:
        voice.say(f"wrote {path}")


def judge_domain(lost: int, unit: str, reachable: bool, path: Path, nothing: str, fix: str) -> None:
    """Turn what was found of a reachable domain into the exit code.

    Parameters
    ----------
    lost : int
        How many answers were lost to failures.
    unit : str
        What they are, in the plural.
    reachable : bool
        Whether any facet is.
    path : Path
        Where the result is.
    nothing, fix : str
        What to say, and to advise, where none is.

    Raises
    ------
    PartialResult
        If some were lost.
    NothingFeasible
        If no facet is reachable.
    """
    if lost:
        told = f"{lost} {unit} were lost to failures and stand as unresolved"
        raise PartialResult(told, where=str(path), fix="--resume tries them again")
    if not reachable:
        raise NothingFeasible(nothing, where=str(path), fix=fix)

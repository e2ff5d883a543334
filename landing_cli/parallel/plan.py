"""Where work runs, and the one call that runs it."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

from landing_cli.errors import UsageError
from landing_cli.parallel.chunks import LostChunk

C = TypeVar("C")
R = TypeVar("R")

BACKENDS = ("threads", "loky", "dask")


@dataclass(frozen=True)
class WorkPlan:
    """Where chunks of work run.

    Attributes
    ----------
    jobs : int
        Threads or processes; a Dask cluster brings its own number.
    backend : {"threads", "loky", "dask"}
    scheduler : str or None
        Address of the Dask scheduler (``tcp://host:8786``); only for ``dask``.

    Raises
    ------
    UsageError
        If the three do not fit together.
    """

    jobs: int = 1
    backend: Literal["threads", "loky", "dask"] = "threads"
    scheduler: str | None = None

    def __post_init__(self) -> None:
        """Refuse a plan that cannot be carried out."""
        if self.jobs < 1:
            raise UsageError(f"{self.jobs} jobs", where="--jobs", fix="give 1 or more")
        if self.backend not in BACKENDS:
            raise UsageError(
                f"unknown backend '{self.backend}'",
                where="--backend",
                fix=f"take one of {', '.join(BACKENDS)}",
            )
        if self.backend == "dask" and not self.scheduler:
            raise UsageError(
                "the dask backend needs the address of a scheduler",
                where="--backend dask",
                fix="add --scheduler tcp://HOST:8786 (from `dask scheduler`; then `dask worker tcp://HOST:8786`)",
            )
        if self.scheduler and self.backend != "dask":
            raise UsageError(
                f"a scheduler is for the dask backend, not for {self.backend}",
                where="--scheduler",
                fix="add --backend dask",
            )


def run_chunks(
    function: Callable[[C], R], chunks: Sequence[C], plan: WorkPlan
) -> Generator[tuple[int, R | LostChunk[C]], None, None]:
    """Run a function on every chunk and yield the answers as they come.

    Parameters
    ----------
    function : callable
        Takes a chunk, returns its answer; picklable for ``loky`` and ``dask``. What it raises
        ends the run.
    chunks : sequence of sequences or arrays
        Each can be sliced; a chunk that keeps killing its worker is cut in halves.
    plan : WorkPlan
        Where to run.

    Yields
    ------
    (int, R or LostChunk)
        Index of the chunk, and its answer, in the order of completion. A chunk that was cut
        comes in several pieces under the same index; items at fault come as ``LostChunk``.

    Raises
    ------
    InputRefused
        If the cluster does not answer, or its workers cannot run this package.

    Notes
    -----
    Close the generator (``contextlib.closing``) where the loop may be left early: it cancels
    what waits, kills worker processes, and waits at most a second for running threads.
    """
    if plan.backend == "threads":
        from landing_cli.parallel.threads import run_on_threads

        return run_on_threads(function, chunks, plan.jobs)
    if plan.backend == "loky":
        from landing_cli.parallel.processes import run_on_processes

        return run_on_processes(function, chunks, plan.jobs)
    from landing_cli.parallel.cluster import run_on_cluster

    assert plan.scheduler is not None  # WorkPlan holds it to this
    return run_on_cluster(function, chunks, plan.scheduler)

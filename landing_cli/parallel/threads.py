"""Chunks on joblib threads: the kernels release the GIL, so nothing is pickled."""

from __future__ import annotations

import threading
import time
import warnings
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from typing import Generic, TypeVar

from landing_cli.parallel.chunks import LostChunk

C = TypeVar("C")
R = TypeVar("R")

LONGEST_WAIT_S = 1.0


class _Stoppable(Generic[C, R]):
    """A function on chunks that can be told to start no more, and knows when it is idle."""

    def __init__(self, function: Callable[[C], R]) -> None:
        self._function = function
        self._running = 0
        self._stopped = False
        self._changed = threading.Condition()

    def __call__(self, index: int, chunk: C) -> tuple[int, R | None]:
        with self._changed:
            if self._stopped:
                return index, None
            self._running += 1
        try:
            return index, self._function(chunk)
        finally:
            with self._changed:
                self._running -= 1
                self._changed.notify_all()

    def stop(self) -> None:
        """Start nothing more; wait for what runs, but not longer than a chunk should take.

        A thread inside a kernel while the interpreter shuts down could crash it.
        """
        deadline = time.monotonic() + LONGEST_WAIT_S
        with self._changed:
            self._stopped = True
            while self._running and time.monotonic() < deadline:
                self._changed.wait(deadline - time.monotonic())


def run_on_threads(
    function: Callable[[C], R], chunks: Sequence[C], jobs: int
) -> Generator[tuple[int, R | LostChunk[C]], None, None]:
    """Run chunks on threads of this process; see ``run_chunks``.

    Parameters
    ----------
    function : callable
        Called from several threads at once.
    chunks : sequence
        The work.
    jobs : int
        Number of threads.

    Yields
    ------
    (int, R)
        Index of a chunk and its answer, in the order of completion.
    """
    from joblib import Parallel, delayed

    task = _Stoppable(function)
    parallel = Parallel(n_jobs=jobs, backend="threading", return_as="generator_unordered", batch_size=1)
    # joblib warns when its generator is left early, which is how an interrupt looks to it.
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="joblib")
        answers = parallel(delayed(task)(index, chunk) for index, chunk in enumerate(chunks))
        try:
            with closing(answers):
                yield from answers
        finally:
            task.stop()

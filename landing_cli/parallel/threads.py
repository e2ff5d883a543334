"""Chunks on joblib threads: the kernels release the GIL, so nothing is pickled."""

from __future__ import annotations

import threading
import time
import warnings
from collections.abc import Callable, Generator, Sequence
from typing import Generic, TypeVar

from landing_cli.parallel.chunks import LostChunk

C = TypeVar("C")
R = TypeVar("R")

LONGEST_WAIT_S = 1.0
AFOOT_PER_JOB = 2


class _Gate(Generic[C, R]):
    """A function on chunks that never runs far ahead of whoever records its answers.

    Parameters
    ----------
    function : callable
        The work.
    most_afoot : int
        How many chunks may be running or wait to be taken: what a kill can cost.
    """

    def __init__(self, function: Callable[[C], R], most_afoot: int) -> None:
        self._function = function
        self._most_afoot = most_afoot
        self._afoot = 0
        self._running = 0
        self._stopped = False
        self._changed = threading.Condition()

    def __call__(self, index: int, chunk: C) -> tuple[int, R | None]:
        with self._changed:
            while self._afoot >= self._most_afoot and not self._stopped:
                self._changed.wait()
            if self._stopped:
                return index, None
            self._afoot += 1
            self._running += 1
        try:
            return index, self._function(chunk)
        finally:
            with self._changed:
                self._running -= 1
                self._changed.notify_all()

    def taken(self) -> None:
        """Let another chunk begin: an answer has been taken and dealt with."""
        with self._changed:
            self._afoot -= 1
            self._changed.notify_all()

    def stop(self) -> None:
        """Let nothing more begin."""
        with self._changed:
            self._stopped = True
            self._changed.notify_all()

    def wait(self) -> None:
        """Wait for what runs, but not longer than a chunk should take.

        A thread inside a kernel while the interpreter shuts down could crash it.
        """
        deadline = time.monotonic() + LONGEST_WAIT_S
        with self._changed:
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
    if jobs == 1:  # nothing to share out: this thread does, and joblib need not be loaded
        for index, chunk in enumerate(chunks):
            yield index, function(chunk)
        return
    from joblib import Parallel, delayed

    gate = _Gate(function, AFOOT_PER_JOB * jobs)
    parallel = Parallel(n_jobs=jobs, backend="threading", return_as="generator_unordered", batch_size=1)
    # joblib warns when its generator is left early, which is how an interrupt looks to it.
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="joblib")
        answers = parallel(delayed(gate)(index, chunk) for index, chunk in enumerate(chunks))
        try:
            for answer in answers:
                yield answer
                gate.taken()
        finally:
            gate.stop()
            answers.close()
            gate.wait()

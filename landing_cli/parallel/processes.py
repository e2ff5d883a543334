"""Chunks on loky processes, one pipe a worker, so that a death names the chunk it happened on.

The processes are loky's (joblib starts a fresh interpreter for each); the dispatch is our own. A
loky executor shares one result pipe among its workers: it waits for ever for the rest of an answer
whose sender was killed, and it fails every chunk in flight when one worker dies.
"""

from __future__ import annotations

import os
import pickle
import signal
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import wait
from typing import Any, Generic, TypeVar

from landing_cli.parallel.blas import BLAS_PINS
from landing_cli.parallel.chunks import Attempt, LostChunk
from landing_cli.parallel.worker import serve

C = TypeVar("C")
R = TypeVar("R")

STARTS_BEFORE_GIVING_UP = 10


def run_on_processes(
    function: Callable[[C], R], chunks: Sequence[C], jobs: int
) -> Generator[tuple[int, R | LostChunk[C]], None, None]:
    """Run chunks on worker processes; see ``run_chunks``.

    Parameters
    ----------
    function : callable
        Picklable.
    chunks : sequence
        The work.
    jobs : int
        Number of processes.

    Yields
    ------
    (int, R or LostChunk)
        Index of a chunk and its answer, in the order of completion.
    """
    pool: _Pool[C, R] = _Pool(function, chunks, jobs)
    try:
        while pool.has_work():
            pool.hire()
            pool.hand_out()
            yield from pool.answers()
    finally:
        pool.kill()


class _Worker(Generic[C]):
    """One process, its pipe, and the chunk that it works on."""

    def __init__(self) -> None:
        from joblib.externals.loky.backend import get_context

        self.connection, theirs = Pipe()
        self.attempt: Attempt[C] | None = None
        self.ready = False
        self.process = get_context("loky").Process(target=serve, args=(theirs, os.getpid()), env=BLAS_PINS)
        # The child inherits the mask: Ctrl-C while it starts up must not end it with a traceback.
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self.process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            theirs.close()

    def send(self, packed: bytes) -> None:
        """Send; a death is noticed when the answer is awaited."""
        with suppress(OSError):
            self.connection.send_bytes(packed)

    def kill(self) -> str:
        """End the process, if it still runs, and return in words how it ended."""
        self.connection.close()
        self.process.join(timeout=0.5)
        if self.process.is_alive():
            os.kill(self.process.pid, signal.SIGKILL)
            self.process.join()
        return _epitaph(self.process.exitcode)


class _Pool(Generic[C, R]):
    """Workers, the chunks that wait, and what to do when a worker dies."""

    def __init__(self, function: Callable[[Any], R], chunks: Sequence[C], jobs: int) -> None:
        self._function = pickle.dumps(function)
        self._waiting = deque(Attempt(i, chunk) for i, chunk in enumerate(chunks))
        self._jobs = jobs
        self._workers: list[_Worker[C]] = []
        self._failed_starts = 0

    def has_work(self) -> bool:
        return bool(self._waiting) or any(w.attempt for w in self._workers)

    def hire(self) -> None:
        """Start as many workers as there is work for."""
        idle = sum(w.attempt is None for w in self._workers)
        for _ in range(min(self._jobs - len(self._workers), len(self._waiting) - idle)):
            self._workers.append(_Worker())

    def hand_out(self) -> None:
        """Give every idle worker a chunk."""
        for worker in self._workers:
            if worker.ready and worker.attempt is None and self._waiting:
                worker.attempt = self._waiting.popleft()
                worker.send(pickle.dumps(worker.attempt.items))

    def answers(self) -> Iterator[tuple[int, R | LostChunk[C]]]:
        """Wait for some workers to speak; yield the chunks that are done or lost."""
        by_connection = {w.connection: w for w in self._workers}
        for connection in wait(list(by_connection)):
            worker = by_connection[connection]  # type: ignore[index]
            attempt = worker.attempt
            try:
                kind, content = worker.connection.recv()
            except (EOFError, OSError):
                yield from self._bury(worker)
                continue
            if kind == "error":
                raise content
            if kind == "hello":
                worker.send(self._function)
                continue
            self._failed_starts = 0
            worker.ready, worker.attempt = True, None
            self.hand_out()
            if attempt:
                yield attempt.index, content

    def _bury(self, worker: _Worker[C]) -> Iterator[tuple[int, LostChunk[C]]]:
        self._workers.remove(worker)
        reason = worker.kill()
        if worker.attempt:
            again = worker.attempt.after_kill()
            self._waiting.extend(again)
            if not again:
                yield worker.attempt.index, LostChunk(worker.attempt.items, reason)
        elif not worker.ready:
            self._failed_starts += 1
            if self._failed_starts >= STARTS_BEFORE_GIVING_UP:
                while self._waiting:
                    lost = self._waiting.popleft()
                    yield lost.index, LostChunk(lost.items, f"no worker could be started: {reason}")

    def kill(self) -> None:
        """End every worker at once; they hold nothing that must be kept."""
        for worker in self._workers:
            with suppress(ProcessLookupError):
                os.kill(worker.process.pid, signal.SIGKILL)
        for worker in self._workers:
            worker.kill()
        self._workers.clear()


def _epitaph(exit_code: int | None) -> str:
    if exit_code is not None and exit_code < 0:
        name = signal.Signals(-exit_code).name
        hint = " (out of memory, or killed from outside)" if name == "SIGKILL" else ""
        return f"its worker process died of {name}{hint}"
    return f"its worker process ended with exit code {exit_code}"

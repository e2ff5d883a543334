"""Chunks on the workers of a Dask cluster."""

from __future__ import annotations

import logging
import pickle
import queue
import sys
import time
import uuid
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import suppress
from typing import Any, Generic, TypeVar

from landing_cli import __version__
from landing_cli.errors import InputRefused
from landing_cli.parallel.chunks import Attempt, LostChunk

C = TypeVar("C")
R = TypeVar("R")

CONNECT_TIMEOUT_S = 10.0
PREFLIGHT_TIMEOUT_S = 60.0
SILENCE_BEFORE_GIVING_UP_S = 60.0
CHUNKS_IN_FLIGHT_PER_THREAD = 2


def run_on_cluster(
    function: Callable[[C], R], chunks: Sequence[C], scheduler: str
) -> Generator[tuple[int, R | LostChunk[C]], None, None]:
    """Run chunks on a Dask cluster; see ``run_chunks``.

    Parameters
    ----------
    function : callable
        Picklable, from a module that the workers can import.
    chunks : sequence
        The work.
    scheduler : str
        Address, ``tcp://host:port``.

    Yields
    ------
    (int, R or LostChunk)
        Index of a chunk and its answer, in the order of completion.

    Raises
    ------
    InputRefused
        If no scheduler or worker answers, or a worker has another version of this package.
    """
    client = _connect(scheduler)
    dispatch: _Dispatch[C, R] | None = None
    try:
        _preflight(client, scheduler)
        dispatch = _Dispatch(client, function, chunks, scheduler)
        while dispatch.has_work():
            dispatch.submit()
            yield from dispatch.answers()
    finally:
        with suppress(Exception):
            if dispatch is not None:
                dispatch.close()
            client.close(timeout=1.0)


def worker_versions() -> dict[str, str]:
    """Versions that decide whether a worker computes the same numbers.

    Returns
    -------
    dict of str
        Versions of this package, Python, numpy and numba.
    """
    import numba
    import numpy

    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    return {"landing": __version__, "python": python, "numpy": numpy.__version__, "numba": numba.__version__}


def _connect(scheduler: str) -> Any:
    try:
        from distributed import Client
    except ImportError as error:
        raise InputRefused(
            "the dask backend needs a package that is not installed here",
            where="--backend dask",
            fix='pip install "landing[cluster]"',
        ) from error
    for name in ("distributed", "tornado"):  # what matters is said in our own words
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        make: Any = Client  # distributed's own annotations are partial
        return make(scheduler, timeout=CONNECT_TIMEOUT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputRefused(
            f"no Dask scheduler answers within {CONNECT_TIMEOUT_S:.0f} s",
            where=f"--scheduler {scheduler}",
            fix="start one with `dask scheduler`, and workers with `dask worker ADDRESS`",
        ) from error


def _preflight(client: Any, scheduler: str) -> None:
    """Let every worker import this package before the work begins.

    A task that cannot be loaded is tried for ever, or fails far from its cause.
    """
    where = f"--scheduler {scheduler}"
    workers = _threads_by_worker(client)
    if not workers:
        raise InputRefused(
            "the cluster has no worker", where=where, fix=f"start some with `dask worker {scheduler}`"
        )
    install = f'pip install "landing[cluster]=={__version__}" in the Python that runs the worker, restart it'
    tasks = {w: client.submit(worker_versions, workers=[w], pure=False, retries=0) for w in workers}
    ours = worker_versions()
    for worker, task in tasks.items():
        try:
            theirs = task.result(timeout=PREFLIGHT_TIMEOUT_S)
        except ImportError as error:
            raise InputRefused(
                f"worker {worker} lacks a package: {error}", where=where, fix=install
            ) from error
        except Exception as error:
            told = f"worker {worker} failed a first task: {str(error) or type(error).__name__}"
            raise InputRefused(told, where=where, fix=install) from error
        differences = [f"{k} {theirs.get(k)} (here {v})" for k, v in ours.items() if theirs.get(k) != v]
        if differences:
            raise InputRefused(f"worker {worker} has {', '.join(differences)}", where=where, fix=install)


def _threads_by_worker(client: Any) -> dict[str, int]:
    """Return the workers that the scheduler knows; none when it does not answer."""
    try:
        return dict(client.nthreads(callback_timeout=5.0))
    except Exception:
        return {}


class _Dispatch(Generic[C, R]):
    """Chunks that wait, chunks in flight, and suspects that are tried alone."""

    def __init__(
        self, client: Any, function: Callable[[Any], R], chunks: Sequence[C], scheduler: str
    ) -> None:
        from landing_cli.parallel.cluster_worker import RunFunction

        self._client = client
        self._run = f"landing-{uuid.uuid4().hex}"
        self._scheduler = scheduler
        client.register_plugin(RunFunction(self._run, pickle.dumps(function)))
        self._waiting = deque(Attempt(i, chunk) for i, chunk in enumerate(chunks))
        self._suspects: deque[Attempt[C]] = deque()
        self._in_flight: dict[Any, Attempt[C]] = {}
        self._arrived: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._last_sign_of_life = time.monotonic()
        self._room = CHUNKS_IN_FLIGHT_PER_THREAD * sum(_threads_by_worker(client).values())

    def close(self) -> None:
        """Let the workers forget the function."""
        if self._client.status == "running":
            self._client.unregister_worker_plugin(self._run)

    def has_work(self) -> bool:
        return bool(self._waiting or self._suspects or self._in_flight)

    def submit(self) -> None:
        """Keep every worker thread busy; suspects run alone, so that no neighbour is blamed."""
        if self._client.status != "running":
            return
        while self._waiting and len(self._in_flight) < self._room:
            self._send(self._waiting.popleft())
        if self._suspects and not self._in_flight:
            self._send(self._suspects.popleft())

    def _send(self, attempt: Attempt[C]) -> None:
        from landing_cli.parallel.cluster_worker import answer

        future = self._client.submit(answer, self._run, attempt.items, pure=False)
        self._in_flight[future] = attempt
        future.add_done_callback(self._arrived.put)

    def answers(self) -> Iterator[tuple[int, R | LostChunk[C]]]:
        """Wait a second for chunks to come back; yield those that are done or lost."""
        try:
            future = self._arrived.get(timeout=1.0)
        except queue.Empty:
            yield from self._check_pulse()
            return
        self._last_sign_of_life = time.monotonic()
        attempt = self._in_flight.pop(future)
        if future.status == "finished":
            yield attempt.index, future.result()
        elif future.status == "error":
            yield from self._after_error(attempt, future.exception())
        else:  # cancelled or lost with the connection
            self._waiting.append(attempt)

    def _after_error(self, attempt: Attempt[C], error: BaseException) -> Iterator[tuple[int, LostChunk[C]]]:
        from distributed import KilledWorker

        if not isinstance(error, KilledWorker):
            raise error
        again = attempt.after_kill()
        self._suspects.extend(again)
        if not again:
            reason = f"{error.allowed_failures + 1} Dask workers died while solving it, twice"
            yield attempt.index, LostChunk(attempt.items, reason)

    def _check_pulse(self) -> Iterator[tuple[int, LostChunk[C]]]:
        """Give up when the cluster has had no worker for long: nothing would ever come back."""
        threads = sum(_threads_by_worker(self._client).values())
        now = time.monotonic()
        if threads:
            self._last_sign_of_life = now
            self._room = CHUNKS_IN_FLIGHT_PER_THREAD * threads
        elif now - self._last_sign_of_life > SILENCE_BEFORE_GIVING_UP_S:
            reason = f"no worker at {self._scheduler} for {SILENCE_BEFORE_GIVING_UP_S:.0f} s"
            for attempt in (*self._in_flight.values(), *self._suspects, *self._waiting):
                yield attempt.index, LostChunk(attempt.items, reason)
            for work in (self._in_flight, self._suspects, self._waiting):
                work.clear()

"""Tasks shared out among forked copies of this process, for what they leave behind on disk."""

from __future__ import annotations

import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress

from landing_cli.parallel.worker import die_with

Task = Callable[[], object]

PATIENCE_S = 120.0  # with a copy, after this process did its own share
_TICK_S = 0.02


def share_out(tasks: Sequence[Task], processes: int) -> None:
    """Run every task once, in this process or in a forked copy of it.

    Copies see everything as it was at the fork; what they return or raise is lost. Where other threads work,
    which a fork would not copy, nor the locks they hold let go, this process does it all. Daemon threads may
    wait beside it, as the watchdog of signals does.

    Parameters
    ----------
    tasks : sequence of callable
        Longest first: each process takes the next one that nobody has taken.
    processes : int
        How many work, this one included.
    """
    if any(not thread.daemon for thread in threading.enumerate() if thread is not threading.current_thread()):
        processes = 1
    waiting, filled = os.pipe()
    os.write(filled, bytes(range(len(tasks))))
    os.close(filled)
    copies: list[int] = []
    try:
        with suppress(OSError):  # no more processes are allowed: fewer do the work
            for _ in range(min(processes, len(tasks)) - 1):
                copies.append(_fork(tasks, waiting))  # noqa: PERF401 (kept where a later one fails)
        _work(tasks, waiting)
        _wait(copies)
    finally:
        os.close(waiting)
        for copy in copies:
            with suppress(ProcessLookupError, ChildProcessError):
                os.kill(copy, signal.SIGKILL)
                os.waitpid(copy, 0)


def _fork(tasks: Sequence[Task], waiting: int) -> int:
    parent = os.getpid()
    # no signal is handled before it is known whose it is
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of forks beside threads, from Python 3.12
            copy = os.fork()
    except OSError:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        raise
    if copy == 0:
        code = 1
        try:
            signal.set_wakeup_fd(-1)  # it leads to the parent's watchdog
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                signal.signal(number, signal.SIG_IGN)
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            die_with(parent)
            nowhere = os.open(os.devnull, os.O_RDWR)
            for stream in (0, 1, 2):
                os.dup2(nowhere, stream)
            _work(tasks, waiting)
            code = 0
        finally:
            os._exit(code)
    signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    return copy


def _work(tasks: Sequence[Task], waiting: int) -> None:
    """Take tasks until none is left: a byte comes out of the pipe for one reader only."""
    while taken := os.read(waiting, 1):
        tasks[taken[0]]()


def _wait(copies: list[int]) -> None:
    """Wait until the copies are done, but not for ever."""
    patience = time.monotonic() + PATIENCE_S
    while copies and time.monotonic() < patience:
        for copy in list(copies):
            if os.waitpid(copy, os.WNOHANG)[0]:
                copies.remove(copy)
        time.sleep(_TICK_S)

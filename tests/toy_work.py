"""Work for the tests of dispatch, importable by worker processes."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused


def squares(chunk: Sequence[int], pause_s: float = 0.0) -> NDArray[np.int64]:
    time.sleep(pause_s)
    return np.array(chunk, dtype=np.int64) ** 2


def notes(file: Path, chunk: Sequence[int]) -> NDArray[np.int64]:
    """Leave one character in a file for every chunk that is begun."""
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.write(descriptor, b"x")
    os.close(descriptor)
    return squares(chunk)


def gets_stuck(chunk: Sequence[int]) -> NDArray[np.int64]:
    """Answer the first chunk, and take half a minute for any other."""
    return squares(chunk, 30.0 if chunk[0] else 0.0)


def big_answer(chunk: Sequence[int]) -> NDArray[np.float64]:
    """More than a pipe holds."""
    return np.full((len(chunk), 200_000), float(chunk[0]))


def dies_on(bad: int, chunk: Sequence[int]) -> NDArray[np.int64]:
    if bad in chunk:
        os.kill(os.getpid(), signal.SIGKILL)
    return squares(chunk)


def dies_once(mark: Path, bad: int, chunk: Sequence[int]) -> NDArray[np.int64]:
    if bad in chunk and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGSEGV)
    return squares(chunk)


def refuses(chunk: Sequence[int]) -> None:
    raise InputRefused("no", where=f"chunk {chunk[0]}", fix="none")


def who_am_i(chunk: Sequence[int]) -> dict[str, object]:
    return {
        "pid": os.getpid(),
        "sigint": signal.getsignal(signal.SIGINT) == signal.SIG_IGN,
        "masked": signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []),
        "blas": os.environ.get("OPENBLAS_NUM_THREADS"),
    }


class Unloadable:
    """Work that ends every interpreter that unpacks it."""

    def __call__(self, chunk: Sequence[int]) -> None:
        raise AssertionError

    def __reduce__(self) -> tuple[object, ...]:
        return os._exit, (3,)

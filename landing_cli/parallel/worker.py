"""The worker process: receives a function once, then chunks, and answers each."""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import traceback
from multiprocessing.connection import Connection
from typing import Any

PR_SET_PDEATHSIG = 1


def serve(connection: Connection, parent: int) -> None:
    """Answer chunks until the connection closes.

    Parameters
    ----------
    connection : Connection
        Says ``hello``, receives the function, says ``ready``, then answers every chunk with
        ``("done", answer)`` or ``("error", exception)``. It speaks only when spoken to, so
        that neither side can block the other.
    parent : int
        Process id of the parent; the worker dies with it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    die_with(parent)
    try:
        _answer(connection)
    except (EOFError, OSError):
        return  # the parent is gone


def die_with(parent: int) -> None:
    """Ask the kernel for SIGKILL when the parent dies, however it dies.

    Parameters
    ----------
    parent : int
        Process id of the parent.
    """
    libc = ctypes.CDLL(None)
    if hasattr(libc, "prctl"):
        libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:  # it died before the kernel knew
        os._exit(1)


def _answer(connection: Connection) -> None:
    connection.send(("hello", None))
    packed = connection.recv_bytes()
    try:
        function = pickle.loads(packed)
    except Exception as error:
        connection.send(("error", _portable(error)))
        return
    connection.send(("ready", None))
    while True:
        chunk = connection.recv()
        try:
            message: tuple[str, Any] = ("done", function(chunk))
        except Exception as error:
            message = ("error", _portable(error))
        connection.send(message)


def _portable(error: Exception) -> Exception:
    """Return the error itself where it survives pickling, else its text."""
    story = "".join(traceback.format_exception(error))
    error.add_note(f"in a worker process:\n{story}")
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(story)
    return error

"""What a Dask worker keeps: the function of the run, received once instead of with every chunk."""

from __future__ import annotations

import pickle
from typing import Any

from distributed import Worker, WorkerPlugin, get_worker


class RunFunction(WorkerPlugin):
    """The function of a run; the scheduler hands it to every worker, those that join later too.

    Parameters
    ----------
    name : str
        Of the run.
    packed : bytes
        The pickled function.
    """

    def __init__(self, name: str, packed: bytes) -> None:
        self.name = name
        self._packed = packed
        self._function: Any = None

    def setup(self, worker: Worker) -> None:
        """Wait for the first chunk to unpack: an error then reaches the run."""

    def __call__(self, chunk: Any) -> Any:
        """Answer a chunk."""
        if self._function is None:
            self._function = pickle.loads(self._packed)
        return self._function(chunk)


def answer(name: str, chunk: Any) -> Any:
    """Answer a chunk by the function that this worker keeps.

    Parameters
    ----------
    name : str
        Of the run.
    chunk : object
        The work.

    Returns
    -------
    object
        The function's answer.
    """
    plugin: Any = get_worker().plugins[name]
    return plugin(chunk)

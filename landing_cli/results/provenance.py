"""How, when and where a result was made: what may differ between two equal results."""

from __future__ import annotations

import os
import platform
import shlex
import sys
import time
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

from landing_cli.results.tree import Attribute

PACKAGES = ("numpy", "scipy", "numba", "h5py", "joblib")


@dataclass(frozen=True)
class Stopwatch:
    """Started with a run, asked at its end."""

    started_utc: str = field(default_factory=lambda: _now())
    _wall: float = field(default_factory=time.monotonic)
    _cpu: float = field(default_factory=time.process_time)

    def provenance(self, **more: Attribute) -> dict[str, Attribute]:
        """Tell how, when and where.

        Parameters
        ----------
        **more : str, int, float
            What else the command knows (jobs, backend, chunks taken over from a journal).

        Returns
        -------
        dict
            For ``/provenance``.
        """
        return {
            "command_line": shlex.join(sys.argv),
            "started_utc": self.started_utc,
            "finished_utc": _now(),
            "wall_s": round(time.monotonic() - self._wall, 3),
            "cpu_s": round(time.process_time() - self._cpu, 3),
            "machine": f"{platform.node()} ({platform.machine()}, {os.cpu_count()} cores)",
            "system": platform.platform(),
            "python": platform.python_version(),
            "packages": ", ".join(f"{name} {_version(name)}" for name in PACKAGES),
            **more,
        }


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"

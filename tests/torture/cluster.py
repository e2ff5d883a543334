"""A Dask cluster of two worker processes on loopback."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from programs import environment

PORT = "38787"
ADDRESS = f"tcp://127.0.0.1:{PORT}"


@contextmanager
def cluster(folder: Path) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Start the scheduler and the workers, each under its nanny; yield the nannies."""
    from distributed import Client

    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder, "env": environment()}
    python = [sys.executable, "-m"]
    scheduler = [
        *python,
        "distributed.cli.dask_scheduler",
        "--host=127.0.0.1",
        f"--port={PORT}",
        "--no-dashboard",
    ]
    worker = [*python, "distributed.cli.dask_worker", ADDRESS, "--nthreads=1", "--no-dashboard"]
    started = [subprocess.Popen(command, **quiet) for command in (scheduler, worker, worker)]
    try:
        with Client(ADDRESS, timeout=30, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=30)
        yield started[1:]
    finally:
        for process in reversed(started):
            process.terminate()
            try:
                process.wait(timeout=5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

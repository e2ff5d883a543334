"""The same numbers, bit for bit, however the work is spread."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from programs import Reference, Tally, digest_of, environment, finish

PORT = "38787"
ADDRESS = f"tcp://127.0.0.1:{PORT}"


def same_numbers(reference: Reference, folder: Path, dask: bool = True) -> Tally:
    """Vary jobs, backend, hash seed and BLAS threads."""
    tally = Tally(f"{reference.program.name}: the same numbers")
    ways = [(backend, jobs, seed) for backend in ("threads", "loky") for jobs in (1, 2, 4) for seed in "01"]
    for backend, jobs, seed in ways:
        variables = {"PYTHONHASHSEED": seed, "OPENBLAS_NUM_THREADS": "4" if seed == "1" else "1"}
        _compare(tally, reference, folder, f"{backend}-{jobs}-{seed}", (backend, jobs), variables)
    if dask:
        with _cluster(folder):
            _compare(tally, reference, folder, "dask", ("dask", 1, "--scheduler", ADDRESS), {})
    return tally


def _compare(
    tally: Tally, reference: Reference, folder: Path, name: str, plan: tuple, variables: dict[str, str]
) -> None:
    output = folder / f"same-{name}" / "run.h5"
    ended = finish(reference.program.command(output, *plan), variables)
    complaints = [] if ended.code == 0 else [f"exit code {ended.code}: {ended.stderr[-200:]}"]
    if not complaints and digest_of(output) != reference.digest:
        complaints.append("the result differs")
    tally.record(name, complaints)


@contextmanager
def _cluster(folder: Path) -> Iterator[None]:
    """Start a scheduler and two worker processes on loopback."""
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
        yield
    finally:
        for process in reversed(started):
            process.terminate()
            try:
                process.wait(timeout=5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

"""The same numbers, bit for bit, however the work is spread."""

from __future__ import annotations

from pathlib import Path

from cluster import ADDRESS, cluster
from programs import Reference, Tally, digest_of, finish


def same_numbers(reference: Reference, folder: Path, dask: bool = True) -> Tally:
    """Vary jobs, backend, hash seed and BLAS threads."""
    tally = Tally(f"{reference.program.name}: the same numbers")
    ways = [(backend, jobs, seed) for backend in ("threads", "loky") for jobs in (1, 2, 4) for seed in "01"]
    for backend, jobs, seed in ways:
        variables = {"PYTHONHASHSEED": seed, "OPENBLAS_NUM_THREADS": "4" if seed == "1" else "1"}
        _compare(tally, reference, folder, f"{backend}-{jobs}-{seed}", (backend, jobs), variables)
    if dask:
        with cluster(folder):
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

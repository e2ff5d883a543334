"""Worker processes killed under loky: survived, or named."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
from cluster import ADDRESS, cluster
from kill_runs import children, session_members
from programs import Ended, Reference, Tally, environment, finish

from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import run_from_result
from landing_cli.results.output import journal_path
from landing_cli.results.store import read

DEADLY_FACET = 37  # of the second case


def kill_workers(reference: Reference, runs: int, folder: Path, seed: int = 0) -> Tally:
    """Kill workers at random during runs; nothing may be lost."""
    tally, chance = Tally(f"{reference.program.name}: workers killed"), random.Random(seed)
    for number in range(runs):
        output = folder / f"workers-{number}" / "run.h5"
        process = subprocess.Popen(
            reference.program.command(output, "loky"),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(),
            start_new_session=True,
        )
        killed = 0
        while process.poll() is None:
            time.sleep(chance.uniform(0.4, 0.9))
            workers = [pid for pid, name in session_members(process.pid) if "popen_loky" in name]
            if workers and killed < 4:
                with suppress(ProcessLookupError):
                    os.kill(chance.choice(workers), chance.choice([signal.SIGKILL, signal.SIGSEGV]))
                    killed += 1
        tally.record(f"run {number}, {killed} workers killed", _unharmed(reference, process, output))
    return tally


def kill_dask_workers(reference: Reference, runs: int, folder: Path, seed: int = 0) -> Tally:
    """Kill Dask workers at random during runs; their nannies start them again."""
    tally, chance = Tally(f"{reference.program.name}: Dask workers killed"), random.Random(seed)
    with cluster(folder) as nannies:
        for number in range(runs):
            output = folder / f"dask-workers-{number}" / "run.h5"
            command = reference.program.command(output, "dask", 1, "--scheduler", ADDRESS)
            pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
            process = subprocess.Popen(command, text=True, env=environment(), **pipes)
            killed = 0
            while process.poll() is None:
                time.sleep(chance.uniform(0.1, 0.4))
                workers = [pid for nanny in nannies for pid in children(nanny.pid)]
                if workers and killed < 2 and journal_path(output).exists():
                    with suppress(ProcessLookupError):
                        os.kill(chance.choice(workers), signal.SIGKILL)
                        killed += 1
            tally.record(f"run {number}, {killed} workers killed", _unharmed(reference, process, output))
    return tally


def _unharmed(reference: Reference, process: subprocess.Popen[str], output: Path) -> list[str]:
    told = process.stderr.read() if process.stderr else ""
    if process.returncode:
        return [f"exit code {process.returncode}: {told[-200:]}"]
    return [] if read(output).digest == reference.digest else ["the result differs"]


def deadly_facet(reference: Reference, folder: Path) -> Tally:
    """Record a facet that kills every worker as lost, end with 6, and try it again with --resume."""
    tally = Tally(f"{reference.program.name}: a facet that kills its worker")
    output = folder / "deadly" / "run.h5"
    ended = finish_deadly(reference, output)
    complaints = [] if ended.code == 6 else [f"exit code {ended.code}: {ended.stderr[-200:]}"]
    if not complaints:
        complaints += _accounted_for(reference, output) + reference.resumed(output, "loky")
    tally.record("named, others kept, tried again", complaints)
    return tally


def finish_deadly(reference: Reference, output: Path) -> Ended:
    """Run with one facet that kills every worker."""
    facets = len(run_from_result(read(reference.result)).asteroid.mesh.faces)
    deadly = {"TORTURE_DEADLY": str(facets + DEADLY_FACET)}
    return finish(reference.program.command(output, "loky"), deadly)


def _accounted_for(reference: Reference, output: Path) -> list[str]:
    """Only the facet at fault is lost, with its reason; every other stands as in the undisturbed run."""
    complaints = []
    partial, whole = (run_from_result(read(path)) for path in (output, reference.result))
    for index, (case, other) in enumerate(zip(partial.cases, whole.cases, strict=True)):
        guilty = [DEADLY_FACET] if index == 1 else []
        if list(case.lost) != guilty or any("SIGKILL" not in reason for reason in case.lost.values()):
            complaints.append(f"lost in {case.case.name}: {dict(case.lost)}")
        rows, right = case.solutions.rows, other.solutions.rows
        kept = ~np.isin(right["facet"], guilty)
        if rows["facet"].tolist() != right["facet"].tolist() or rows[kept].tobytes() != right[kept].tobytes():
            complaints.append(f"{case.case.name}: other facets than the undisturbed run's")
        if any(rows["verdict"][~kept] != Verdict.UNRESOLVED):
            complaints.append(f"{case.case.name}: a lost facet is not unresolved")
    return complaints

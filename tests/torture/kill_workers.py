"""Worker processes killed under loky: survived, or named."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

from kill_runs import _session_members
from programs import Reference, Tally, environment, finish

from landing_cli.reach.stored import run_from_result
from landing_cli.results.store import read

DEADLY_FACET = 37


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
            workers = [pid for pid, name in _session_members(process.pid) if "popen_loky" in name]
            if workers and killed < 4:
                with suppress(ProcessLookupError):
                    os.kill(chance.choice(workers), chance.choice([signal.SIGKILL, signal.SIGSEGV]))
                    killed += 1
        told = process.stderr.read() if process.stderr else ""
        complaints = [] if process.returncode == 0 else [f"exit code {process.returncode}: {told[-200:]}"]
        if not complaints and read(output).digest != reference.digest:
            complaints.append("the result differs")
        tally.record(f"run {number}, {killed} workers killed", complaints)
    return tally


def deadly_facet(reference: Reference, folder: Path) -> Tally:
    """Record a facet that kills every worker as lost, end with 6, and try it again with --resume."""
    tally = Tally(f"{reference.program.name}: a facet that kills its worker")
    output = folder / "deadly" / "run.h5"
    ended = finish(reference.program.command(output, "loky", 2, "--deadly", str(DEADLY_FACET)))
    complaints = [] if ended.code == 6 else [f"exit code {ended.code}: {ended.stderr[-200:]}"]
    if not complaints:
        lost = [dict(case.lost) for case in run_from_result(read(output)).cases]
        if [list(names) for names in lost] != [[], [DEADLY_FACET]] or "SIGKILL" not in lost[1][DEADLY_FACET]:
            complaints.append(f"lost: {lost}")
        complaints += reference.resumed(output, "loky")
    tally.record("named, others kept, tried again", complaints)
    return tally

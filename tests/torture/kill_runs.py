"""Runs killed at random instants, resumed, and compared with the undisturbed one."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from programs import Reference, Tally, environment, trace_of

from landing_cli.errors import InputRefused
from landing_cli.results.journal import read_journal
from landing_cli.results.output import journal_path
from landing_cli.results.store import read

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
ANSWERED = {signal.SIGINT: 130, signal.SIGTERM: 143}
ANSWER_S, ORPHANS_S = 2.0, 4.0
JOBS = 2


def kill_runs(reference: Reference, kills: int, folder: Path, seed: int = 0) -> list[Tally]:
    """Kill runs on threads and on loky, by turns with every signal to the group or to the parent alone."""
    chance = random.Random(seed)
    tallies = {b: Tally(f"{reference.program.name}: kills, {b}") for b in reference.seconds}
    for number in range(kills):
        backend = list(tallies)[number % len(tallies)]
        number_of_pair = number // len(tallies)
        caught = SIGNALS[number_of_pair % 4]
        whole_group = bool(number_of_pair // 4 % 2)
        after = chance.uniform(0.05, 1.1 * reference.seconds[backend])
        target = "group" if whole_group else "parent"
        output = folder / f"kill-{number}" / "run.h5"
        stage, complaints = _kill_once(reference, output, backend, caught, whole_group, after)
        tallies[backend].notes[stage] += 1
        tallies[backend].record(f"{caught.name} to the {target} after {after:.2f} s", complaints)
        if number % 10 == 9:
            print(f"{number + 1} of {kills} runs killed", file=sys.stderr, flush=True)
    return list(tallies.values())


def _kill_once(
    reference: Reference, output: Path, backend: str, caught: signal.Signals, whole_group: bool, after: float
) -> tuple[str, list[str]]:
    output.parent.mkdir(parents=True)
    trace = {"TORTURE_TRACE": str(trace_of(output))}
    begun = time.monotonic()
    process = subprocess.Popen(
        reference.program.command(output, backend, JOBS),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(**trace),
        start_new_session=True,
        preexec_fn=_mind_signals,
    )
    armed, stage = False, "ended before"
    try:
        process.wait(timeout=after)
        reference.seconds[backend] = time.monotonic() - begun
    except subprocess.TimeoutExpired:
        armed = _is_caught(process.pid, signal.SIGTERM)  # the interpreter has reached our first lines
        stage = _stage(output)
        (os.killpg if whole_group else os.kill)(process.pid, caught)
    killed = time.monotonic()
    assert process.stderr is not None
    told = process.stderr.read()  # until the last process that holds it is gone
    code = process.wait()
    complaints = _answer(code, caught, time.monotonic() - killed, told, armed, output)
    complaints += _orphans(process.pid, killed)
    recorded, wrong = _on_disk(output)
    before = _traced(output)
    lost = set() if output.exists() else set(before) - set(recorded)
    if len(lost) > 2 * JOBS:
        wrong.append(f"{len(lost)} chunks of {reference.program.chunk_facets} facets to solve again")
    complaints += wrong + reference.resumed(output, backend, trace)
    twice = set(recorded) & set(_traced(output)[len(before) :])
    return stage, complaints + ([f"recorded chunks solved again: {sorted(twice)}"] if twice else [])


def _stage(output: Path) -> str:
    """How far a run has come."""
    if output.exists():
        return "stored"
    return "solving" if trace_of(output).exists() else "starting"


def _mind_signals() -> None:
    """Undo what ``nohup`` or a background job made this process ignore, and its children with it."""
    for number in SIGNALS[1:]:
        signal.signal(number, signal.SIG_DFL)


def _is_caught(pid: int, number: signal.Signals) -> bool:
    """Whether a process has a handler for a signal, which is not so before our first lines have run."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False
    return bool(int(status.split("SigCgt:")[1].split()[0], 16) >> (number - 1) & 1)


def _answer(
    code: int, caught: signal.Signals, seconds: float, told: str, armed: bool, output: Path
) -> list[str]:
    """A run that is asked to stop says so in one line, with its code, in time."""
    lines = told.strip().splitlines()
    state = "stored" if output.exists() else "recording" if journal_path(output).exists() else "not begun"
    ending = f" ({state}): {told.strip()[-300:]!r}"
    complaints = [f"a traceback{ending}"] if "Traceback" in told and (armed or code == 0) else []
    if code == 0:
        return complaints + ([] if output.exists() else [f"ended with 0 and no result{ending}"])
    if not armed or caught not in ANSWERED:
        return complaints
    if code != ANSWERED[caught]:
        complaints.append(f"exit code {code}{ending}")
    if seconds > ANSWER_S:
        complaints.append(f"took {seconds:.1f} s to end")
    if [line for line in lines if line.startswith("interrupted by")] != lines[-1:]:
        complaints.append(f"does not end with its one line{ending}")
    if journal_path(output).exists() and not (lines and "--resume" in lines[-1]):
        complaints.append(f"does not tell of --resume{ending}")
    return complaints


def _orphans(session: int, killed: float) -> list[str]:
    while True:
        alive = [name for pid, name in session_members(session)]
        if not alive:
            return []
        if time.monotonic() > killed + ORPHANS_S:
            break
        time.sleep(0.05)
    return [f"orphans after {ORPHANS_S} s: {alive}"]


def session_members(session: int) -> list[tuple[int, str]]:
    """Pid and command line of the living processes of a session."""
    return [(pid, name) for pid, _, own, name in _processes() if own == session]


def children(parent: int) -> list[int]:
    """Pids of the Python processes that a Dask nanny watches over."""
    return [pid for pid, own, _, name in _processes() if own == parent and "resource_tracker" not in name]


def _processes() -> Iterator[tuple[int, int, int, str]]:
    """Pid, parent, session and command line of every living process."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                state, parent, _, session, *_ = (entry / "stat").read_text().rsplit(")", 1)[1].split()
                name = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
            except OSError:
                continue
            if state != "Z":
                yield int(entry.name), int(parent), int(session), name


def _on_disk(output: Path) -> tuple[list[str], list[str]]:
    """Return the chunks that the journal holds, and what is wrong with result or journal."""
    wrong = []
    if output.exists():
        try:
            read(output)
        except InputRefused as error:
            wrong.append(f"unreadable result: {error}")
    try:
        content = read_journal(journal_path(output))
    except InputRefused as error:
        return [], [*wrong, f"unreadable journal: {error}"]
    return list(content.records) if content else [], wrong


def _traced(output: Path) -> list[str]:
    """Chunks that were begun, in the journal's words."""
    trace = trace_of(output)
    return trace.read_text().splitlines() if trace.exists() else []

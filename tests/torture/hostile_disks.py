"""Full disks, folders that cannot be written, closed stdout: a message, a code, and nothing lost."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from programs import Ended, Reference, Tally, environment, finish

SHARES = (0.0, 0.001, 0.05, 0.3, 0.6, 0.9, 0.99)


def hostile_disks(reference: Reference, folder: Path) -> list[Tally]:
    """Try every way in which output can fail."""
    size = (folder / "undisturbed-threads" / "run.h5").stat().st_size
    return [
        _file_limits(reference, folder, size),
        _full_disks(reference, folder, size),
        _bad_places(reference, folder),
        _stdouts(reference, folder),
        _second_run(reference, folder),
    ]


def _file_limits(reference: Reference, folder: Path, size: int) -> Tally:
    tally = Tally(f"{reference.program.name}: file size limits")
    for share in SHARES:
        for backend in ("threads", "loky"):
            output = folder / f"limit-{share}-{backend}" / "run.h5"
            limit = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (int(share * size),) * 2)
            ended = finish(reference.program.command(output, backend), preexec_fn=limit)
            complaints = refused(ended) or _leftovers(output)
            tally.record(
                f"{backend}, {share} of the result", complaints or reference.resumed(output, backend)
            )
    return tally


def _full_disks(reference: Reference, folder: Path, size: int) -> Tally:
    """Fill small file systems in memory; needs the right to mount them."""
    tally = Tally(f"{reference.program.name}: full disks")
    for share in (0.02, 0.4, 1.1, 1.7):
        with _mounted(folder / f"disk-{share}", f"size={int(share * size) // 4096 * 4096}") as place:
            if place is None:
                break
            output = place / "run.h5"
            ended = finish(reference.program.command(output))
            complaints = refused(ended) or _leftovers(output)
            if not complaints:
                subprocess.run(["mount", "-o", "remount,size=100m", place], check=True)
                complaints = reference.resumed(output)
            tally.record(f"{share} of the result", complaints)
    return tally


def _bad_places(reference: Reference, folder: Path) -> Tally:
    tally = Tally(f"{reference.program.name}: places that cannot be written")
    a_file = folder / "file"
    a_file.write_text("not a folder")
    fifo = folder / "fifo"
    os.mkfifo(fifo)
    sealed = folder / "sealed"
    sealed.mkdir()
    sealed.chmod(0o555)
    places = [a_file / "run.h5", fifo, folder, a_file, Path("/proc/run.h5"), Path("/dev/full")]
    places += [folder / ("x" * 300), *([] if os.geteuid() == 0 else [sealed / "run.h5"])]
    for place in places:
        tally.record(str(place)[-60:], refused(finish(reference.program.command(place))))
    with _mounted(folder / "read-only", "ro") as mounted:
        if mounted is not None:
            tally.record("read-only disk", refused(finish(reference.program.command(mounted / "run.h5"))))
    if a_file.read_text() != "not a folder":
        tally.record("a file of somebody else's", ["was overwritten"])
    return tally


def _stdouts(reference: Reference, folder: Path) -> Tally:
    tally = Tally(f"{reference.program.name}: streams closed or full")
    for name, redirect, expected in [
        ("closed", ">&-", 0),
        ("pipe whose reader has gone", "| head -c 0", 0),
        ("pipe to head -1", "| head -1", 0),
        ("full device", "> /dev/full", 3),
        ("stderr closed", "2>&-", 0),
        ("stderr full", "2> /dev/full", 0),
        ("all closed", "<&- >&- 2>&-", 0),
    ]:
        output = folder / f"stream-{name.replace(' ', '-')}" / "run.h5"
        line = '"$@" ' + redirect + "; exit ${PIPESTATUS[0]}"
        ended = finish(["bash", "-c", line, "bash", *reference.program.command(output)])
        complaints = [] if ended.code == expected else [f"exit code {ended.code}: {ended.stderr[-200:]}"]
        complaints += ["a traceback"] if "Traceback" in ended.stderr or "Exception" in ended.stderr else []
        tally.record(name, complaints or reference.resumed(output))
    return tally


def _second_run(reference: Reference, folder: Path) -> Tally:
    tally = Tally(f"{reference.program.name}: two runs on one output")
    output = folder / "twice" / "run.h5"
    command = reference.program.command(output)
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    first = subprocess.Popen(command, env=environment(), **quiet)
    while first.poll() is None and not output.with_name("run.h5.journal").exists():
        time.sleep(0.01)
    first.send_signal(signal.SIGSTOP)  # it must still be at work, however fast it is
    for choice in ([], ["--resume"], ["--force"]):
        ended = finish([*command, *choice])
        complaints = refused(ended)
        if ended.seconds > reference.seconds["threads"] + 2.0:
            complaints.append(f"waited {ended.seconds:.1f} s")
        tally.record(f"second with {choice}", complaints)
    first.send_signal(signal.SIGCONT)
    complaints = [] if first.wait() == 0 else [f"the first ended with {first.returncode}"]
    tally.record("the first is not disturbed", complaints or reference.resumed(output))
    return tally


def refused(ended: Ended) -> list[str]:
    """Say what is wrong with a refusal: code 3, one line, no traceback."""
    complaints = [] if ended.code == 3 else [f"exit code {ended.code}"]
    lines = [line for line in ended.stderr.splitlines() if line.startswith("error:")]
    if len(lines) != 1 or "Traceback" in ended.stderr:
        complaints.append(f"told: {ended.stderr[-300:]}")
    return complaints


def _leftovers(output: Path) -> list[str]:
    known = {output.name, f"{output.name}.journal"}
    left = {p.name for p in output.parent.iterdir()} - known if output.parent.exists() else set()
    return [f"left behind: {sorted(left)}"] if left else []


@contextmanager
def _mounted(place: Path, options: str) -> Iterator[Path | None]:
    place.mkdir(parents=True)
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "torture", place], capture_output=True, check=False
    )
    try:
        yield place if done.returncode == 0 else None
    finally:
        if done.returncode == 0:
            subprocess.run(["umount", place], check=True)

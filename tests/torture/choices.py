"""What a run says to what lies at its output already."""

from __future__ import annotations

import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

from hostile_disks import refused
from programs import Ended, Reference, Tally, environment, finish

from landing_cli.results.journal import NotAJournal, read_journal
from landing_cli.results.output import journal_path


def choices(reference: Reference, folder: Path) -> Tally:
    """Meet a complete, a different and an unfinished output with every choice."""
    tally = Tally(f"{reference.program.name}: up to date, different, unfinished")
    output = folder / "choices" / "run.h5"
    command = reference.program.command(output)
    finish(command)
    before = output.read_bytes()
    for choice in ([], ["--resume"]):
        ended = finish([*command, *choice])
        tally.record(f"complete, {choice}", _is_up_to_date(ended))
    different = [*command, *reference.program.different]
    for choice in ([], ["--resume"]):
        ended = finish([*different, *choice])
        tally.record(f"different, {choice}", refused(ended) + _says(ended, " -> ", "-o", "--force"))
    tally.record("nothing was touched", [] if output.read_bytes() == before else ["the result was changed"])
    other = output.with_name("other.h5")
    command, different = ([str(other) if w == str(output) else w for w in c] for c in (command, different))
    _interrupt(command, other)
    ended = finish(command)
    tally.record("unfinished", refused(ended) + _says(ended, "chunks are safe", "--resume", "--force"))
    for choice in ([], ["--resume"]):
        ended = finish([*different, *choice])
        complaints = refused(ended) + _says(ended, " -> ", "-o", "--force")
        tally.record(f"unfinished and different, {choice}", complaints)
    ended = finish([*different, "--force"])
    tally.record("unfinished and different, --force", [f"exit code {ended.code}"] if ended.code else [])
    return tally


def _interrupt(command: list[str], output: Path) -> None:
    """Leave an unfinished run: killed once something is recorded."""
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(command, env=environment(), **quiet)
    journal = journal_path(output)
    while process.poll() is None and not _is_recorded(journal):
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()


def _is_recorded(journal: Path) -> bool:
    """Whether a whole record is there; it may be looked at while it is written."""
    if not journal.exists():
        return False
    with suppress(NotAJournal):
        content = read_journal(journal)
        return content is not None and bool(content.records)
    return False


def _is_up_to_date(ended: Ended) -> list[str]:
    complaints = [] if ended.code == 0 else [f"exit code {ended.code}"]
    return complaints + ([] if "up to date" in ended.stderr else [f"told: {ended.stderr[-200:]}"])


def _says(ended: Ended, *words: str) -> list[str]:
    missing = [word for word in words if word not in ended.stderr]
    return [f"does not say {missing}: {ended.stderr[-300:]}"] if missing else []

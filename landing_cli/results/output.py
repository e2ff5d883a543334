"""One run, one output: what is on disk already, and what may be done about it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from landing_cli.errors import InputRefused, OutputRefused
from landing_cli.results.disk import lock_file, refusal
from landing_cli.results.identity import RunIdentity
from landing_cli.results.journal import Journal, JournalContent, NotAJournal, read_journal
from landing_cli.results.tree import Attribute, Group


class OutputState(Enum):
    """What lies at an output path."""

    ABSENT = "nothing"
    COMPLETE_SAME = "the result of this run"
    COMPLETE_OTHER = "the result of a different run"
    UNFINISHED_SAME = "this run, unfinished"
    UNFINISHED_OTHER = "a different run, unfinished"
    DAMAGED = "a damaged result or journal"
    FOREIGN = "a file that this program did not write"


@dataclass(frozen=True)
class OutputReport:
    """What lies at an output path, compared with the run that is about to begin.

    Attributes
    ----------
    path : Path
        Of the result, links resolved.
    state : OutputState
    differences : tuple of str
        What changed since the run on disk; or what is wrong with it.
    recorded : int
        Chunks that its journal holds.
    """

    path: Path
    state: OutputState
    differences: tuple[str, ...] = ()
    recorded: int = 0

    def refuse(self) -> OutputRefused:
        """Return the refusal to write here, with the choices."""
        what = f"holds {self.state.value}"
        if self.recorded:
            what += f" ({self.recorded} chunks are safe)"
        if self.differences:
            what += f": {'; '.join(self.differences)}"
        return OutputRefused(what, where=str(self.path), fix=_CHOICES[self.state])


_CHOICES = {
    OutputState.COMPLETE_OTHER: "choose another place with -o, or replace it with --force",
    OutputState.UNFINISHED_SAME: "continue with --resume, or start over with --force",
    OutputState.UNFINISHED_OTHER: "choose another place with -o, or start over with --force",
    OutputState.DAMAGED: "start over with --force, or choose another place with -o",
    OutputState.FOREIGN: "choose another place with -o",
}


def journal_path(path: Path) -> Path:
    """Return where the journal of a result lies.

    Parameters
    ----------
    path : Path
        Of the result.
    """
    return path.with_name(f"{path.name}.journal")


def inspect_output(path: Path, identity: RunIdentity) -> OutputReport:
    """Compare what lies at an output path with a run; change nothing.

    Parameters
    ----------
    path : Path
        Of the result.
    identity : RunIdentity
        Of the run that is about to begin.

    Returns
    -------
    OutputReport
    """
    path = _resolved(path)
    return _inspect(path, identity)[0]


def open_output(
    path: Path, identity: RunIdentity, *, resume: bool = False, force: bool = False
) -> Journal | None:
    """Lock an output for a run and open its journal.

    Parameters
    ----------
    path : Path
        Of the result; its folder is made if need be.
    identity : RunIdentity
        Of the run.
    resume : bool
        Continue an unfinished run; ``Journal.records`` holds what it recorded.
    force : bool
        Start over, whatever was there, if this program wrote it.

    Returns
    -------
    Journal or None
        None where the result on disk is already that of this run.

    Raises
    ------
    OutputRefused
        If the path cannot be written, another run writes it now, or it holds something that
        these choices do not cover.
    """
    path = _resolved(path)
    if not force and _inspect(path, identity)[0].state is OutputState.COMPLETE_SAME:
        _sweep(journal_path(path))
        return None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise refusal(error, path.parent) from error
    descriptor = lock_file(journal_path(path))
    try:
        report, content = _inspect(path, identity)  # once more: nobody can change it now
        if report.state is OutputState.COMPLETE_SAME and not force:
            _abandon(path, descriptor)
            return None
        resumed = resume and report.state is OutputState.UNFINISHED_SAME
        if not (report.state is OutputState.ABSENT or resumed or (force and _ours(report))):
            raise report.refuse()
        return Journal(journal_path(path), descriptor, identity, content if resumed else None)
    except BaseException:
        _abandon(path, descriptor)
        raise


def finish_output(
    journal: Journal,
    tree: Group,
    root_attributes: Mapping[str, Attribute],
    provenance: Mapping[str, Attribute],
    *,
    complete: bool,
) -> str:
    """Write the result of a run, and drop its journal if the run is complete.

    Parameters
    ----------
    journal : Journal
        From ``open_output``; it is closed.
    tree : Group
        What to store.
    root_attributes : mapping
        The mission, and what else belongs to the file's root; the identity is added.
    provenance : mapping
        How, when and where it was made.
    complete : bool
        Whether every part succeeded. If not, the journal stays, for ``--resume``.

    Returns
    -------
    str
        The result's digest.

    Raises
    ------
    OutputRefused
        If it cannot be written; the journal stays.
    """
    from landing_cli.results.store import write

    attributes = {**root_attributes, **journal.identity.as_dict(), "complete": int(complete)}
    path = journal.path.with_name(journal.path.name.removesuffix(".journal"))
    fingerprint = write(path, tree, attributes, provenance)
    if complete:
        journal.discard()
    else:
        journal.close()
    return fingerprint


def _resolved(path: Path) -> Path:
    try:
        path = Path(os.path.realpath(path))
        if path.is_dir():
            raise OutputRefused("is a folder", where=str(path), fix="name a file with -o")
        if path.exists() and not path.is_file():
            raise OutputRefused("is no regular file", where=str(path), fix="choose another place with -o")
    except OSError as error:
        raise refusal(error, path) from error
    return path


def _ours(report: OutputReport) -> bool:
    return report.state is not OutputState.FOREIGN


def _inspect(path: Path, identity: RunIdentity) -> tuple[OutputReport, JournalContent | None]:
    found = _inspect_result(path, identity)
    if found.state in (OutputState.COMPLETE_SAME, OutputState.FOREIGN):
        return found, None
    try:
        content = read_journal(journal_path(path))
    except NotAJournal as error:
        return OutputReport(path, OutputState.FOREIGN, (str(error),)), None
    except InputRefused as error:
        return OutputReport(path, OutputState.DAMAGED, (str(error),)), None
    if content is None or content.identity is None:
        return found, content
    differences = tuple(identity.differences(content.identity))
    state = OutputState.UNFINISHED_OTHER if differences else OutputState.UNFINISHED_SAME
    return OutputReport(path, state, differences, len(content.records)), content


def _inspect_result(path: Path, identity: RunIdentity) -> OutputReport:
    if not path.exists():
        return OutputReport(path, OutputState.ABSENT)
    from landing_cli.results.store import is_result, read

    try:
        result = read(path)
        differences = tuple(identity.differences(result.identity))
    except InputRefused as error:
        ours = is_result(path)
        return OutputReport(path, OutputState.DAMAGED if ours else OutputState.FOREIGN, (error.what,))
    if differences:
        return OutputReport(path, OutputState.COMPLETE_OTHER, differences)
    return OutputReport(path, OutputState.COMPLETE_SAME if result.complete else OutputState.UNFINISHED_SAME)


def _abandon(path: Path, descriptor: int) -> None:
    """Release the lock, and delete the journal if it is empty: it was made for the lock alone."""
    if os.fstat(descriptor).st_size == 0:
        journal_path(path).unlink(missing_ok=True)
    os.close(descriptor)


def _sweep(journal: Path) -> None:
    """Delete the journal of a run that was killed between storing its result and this deletion."""
    if not journal.exists():
        return
    try:
        descriptor = lock_file(journal)
    except OutputRefused:
        return  # a run that was told to start over writes it now, or we may not
    journal.unlink(missing_ok=True)
    os.close(descriptor)

"""Writing that either reaches the disk or says why not."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
from contextlib import suppress
from pathlib import Path

from landing_cli.errors import OutputRefused
from landing_cli.sources.guarded_file import open_regular

LARGEST_FILE_BYTES = 4 << 30

_STORIES = {
    errno.ENOSPC: ("the disk is full", "free some space"),
    errno.EDQUOT: ("the disk quota is used up", "free some space"),
    errno.EFBIG: ("the limit on file sizes is reached (ulimit -f)", "raise the limit"),
    errno.EROFS: ("the file system is read-only", "choose another place with -o"),
    errno.EACCES: ("no permission to write here", "choose another place with -o"),
    errno.EPERM: ("no permission to write here", "choose another place with -o"),
    errno.ENOENT: ("the folder does not exist", "make it, or choose another place with -o"),
    errno.ENOTDIR: ("a part of the path is a file, not a folder", "choose another place with -o"),
    errno.EISDIR: ("this is a folder", "name a file with -o"),
    errno.ENAMETOOLONG: ("the name is too long", "choose a shorter one with -o"),
    errno.ELOOP: ("the path is a loop of links", "choose another place with -o"),
    errno.EIO: ("the disk reports an input/output error", "check the disk"),
}


def refusal(error: OSError, path: Path, then: str = "") -> OutputRefused:
    """Tell a failed write in the user's terms.

    Parameters
    ----------
    error : OSError
        What the system said.
    path : Path
        What was being written.
    then : str, optional
        What to do once the cause is gone.

    Returns
    -------
    OutputRefused
        To be raised.
    """
    what, fix = _STORIES.get(error.errno or 0, (error.strerror or str(error), "choose another place with -o"))
    return OutputRefused(f"cannot be written: {what}", where=str(path), fix=f"{fix} {then}".strip())


def write_all(descriptor: int, data: bytes | memoryview) -> None:
    """Write every byte; the system may take them in parts.

    Parameters
    ----------
    descriptor : int
        An open file.
    data : bytes or memoryview
        What to write.
    """
    left = memoryview(data).cast("B")
    while left:
        left = left[os.write(descriptor, left) :]


def replace_file(path: Path, *parts: bytes | memoryview) -> None:
    """Put a file in place whole, or not at all, and durably.

    Parameters
    ----------
    path : Path
        Where; what is there is replaced in one step.
    *parts : bytes or memoryview
        The new content, one after another.

    Raises
    ------
    OutputRefused
        If it cannot be written; nothing is left behind then.

    Notes
    -----
    The temporary name is fixed, so that a killed run's leftover is overwritten by the next;
    whoever writes holds the output's lock.
    """
    temporary = path.with_name(f".{path.name}.part")
    try:
        try:
            descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW, 0o666)
            try:
                for part in parts:
                    write_all(descriptor, part)
                os.fsync(descriptor)
            finally:
                os.close(descriptor)
            temporary.replace(path)
        except BaseException:
            with suppress(OSError):
                temporary.unlink()
            raise
        sync_folder(path.parent)
    except OSError as error:
        raise refusal(error, path, "and run again with --resume") from error


def sync_folder(folder: Path) -> None:
    """Make a rename or a deletion in a folder durable, where the system can.

    Parameters
    ----------
    folder : Path
        The folder whose entries changed.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with suppress(OSError):  # some network file systems cannot
            os.fsync(descriptor)
    finally:
        os.close(descriptor)


def read_whole(path: Path) -> bytes:
    """Read a regular file of sensible size; never block on anything else.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    bytes
        Its content.

    Raises
    ------
    InputRefused
        If it is missing, no regular file, unreadable or too large.
    """
    with open_regular(path, LARGEST_FILE_BYTES) as file:
        return file.readall()


def begins_with(path: Path, signature: bytes) -> bool:
    """Look at the first bytes of a regular file of sensible size, and at nothing more.

    Parameters
    ----------
    path : Path
        The file.
    signature : bytes
        What it should begin with.

    Raises
    ------
    InputRefused
        As ``read_whole``.
    """
    with open_regular(path, LARGEST_FILE_BYTES) as file:
        return file.read(len(signature)) == signature


def lock_file(path: Path) -> int:
    """Open a file, made if need be, and hold the only lock on it until it is closed.

    Parameters
    ----------
    path : Path
        The file. Its existence means nothing: only the lock does, and the system drops it
        when the process ends, however it ends.

    Returns
    -------
    int
        Descriptor, open for reading and writing.

    Raises
    ------
    OutputRefused
        If another process holds it, or it cannot be opened.
    """
    while True:
        try:
            flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOFOLLOW
            descriptor = os.open(path, flags, 0o666)
        except OSError as error:
            raise refusal(error, path) from error
        try:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise OutputRefused("is no regular file", where=str(path), fix="choose another place with -o")
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_still(path, descriptor):
                return descriptor
        except BlockingIOError as error:
            os.close(descriptor)
            raise OutputRefused(
                "another run is writing this output",
                where=str(path),
                fix="wait until it ends, or choose another place with -o",
            ) from error
        except OSError as error:
            os.close(descriptor)
            raise refusal(error, path) from error
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)  # its last owner deleted it between our two calls


def _is_still(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(path.lstat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False

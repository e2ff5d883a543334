"""Opening a file from a stranger: regular files only, and never more bytes than agreed."""

from __future__ import annotations

import io
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from landing_cli.errors import InputRefused

_KINDS = {
    stat.S_IFDIR: "a directory",
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}


@contextmanager
def open_regular(path: Path, cap_bytes: int) -> Iterator[io.FileIO]:
    """Open a regular file that is small enough; anything else is refused before a byte is read.

    Parameters
    ----------
    path : Path
        File to read; symbolic links are followed.
    cap_bytes : int
        Largest size accepted.

    Yields
    ------
    io.FileIO
        Positioned at the first byte.

    Raises
    ------
    InputRefused
        If the file is missing, unreadable, no regular file, or too large.
    """
    try:
        # Without O_NONBLOCK the open itself would wait for a writer at the other end of a pipe.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputRefused(f"cannot be read: {reason}", where=str(path)) from error
    try:
        _refuse_unfit(path, os.fstat(descriptor), cap_bytes)
        yield io.FileIO(descriptor, closefd=False)
    finally:
        os.close(descriptor)


def _refuse_unfit(path: Path, status: os.stat_result, cap_bytes: int) -> None:
    kind = stat.S_IFMT(status.st_mode)
    if kind != stat.S_IFREG:
        found = _KINDS.get(kind, "no regular file")
        raise InputRefused(f"is {found}", where=str(path), fix="name a regular file")
    if status.st_size > cap_bytes:
        raise InputRefused(
            f"has {status.st_size / 2**20:.0f} MiB; at most {cap_bytes / 2**20:.0f} MiB are read",
            where=str(path),
        )

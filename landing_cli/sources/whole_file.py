"""Writing a file so that it appears whole or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path


def write_whole(path: Path, data: bytes) -> None:
    """Write bytes to a temporary name beside the path, sync them, and rename.

    Parameters
    ----------
    path : Path
        File to create or replace.
    data : bytes
        Its whole content.

    Raises
    ------
    OSError
        If the system refuses; the old file is then untouched and nothing is left behind.
    """
    if path.exists() and not path.is_file():
        # Renaming would put a file in the place of a device.
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with temporary.open("wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)

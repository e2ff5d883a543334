"""A cache of compiled kernels that never serves a stale one.

numba looks only at the file a kernel is written in; an edit in a module that it imports would go unseen
and old machine code would answer. So the cache folder is named after everything that kernels are made of.
"""

from __future__ import annotations

import hashlib
import os
import stat
from pathlib import Path
from typing import Any

ROOMS = ("body", "flight", "optimize", "reach", "plan", "observe", "tour")
# LLVM's first level: a fifth off the compilation, and the kernels run as fast.
OPTIMISATION_LEVEL = "1"


def fingerprint(package: Path) -> str:
    """Hash names, sizes and times of all files that hold kernels."""
    digest = hashlib.sha256()
    for pattern in ("kernel*.py", *(f"{room}/**/*.py" for room in ROOMS)):
        for file in sorted(package.glob(pattern)):
            if "figures" in file.parts:
                continue
            status = file.stat()
            digest.update(f"{file.relative_to(package)} {status.st_size} {status.st_mtime_ns}\n".encode())
    return digest.hexdigest()[:16]


def use_own_cache() -> None:
    """Point numba to this version's folder, unless NUMBA_CACHE_DIR is set.

    It lies in the user's cache, or, where that cannot be written (a container, a cluster node without a
    home), in a folder of the user's own among the temporary files.
    """
    os.environ.setdefault("NUMBA_OPT", OPTIMISATION_LEVEL)
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    version = fingerprint(Path(__file__).parent)
    cache = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))  # noqa: PTH111
    temporary = Path(os.environ.get("TMPDIR") or "/tmp")
    for base in (cache / "landing" / "kernels", temporary / f"landing-kernels-{os.geteuid()}"):
        if base.is_absolute() and _is_own_folder(base / version):
            os.environ["NUMBA_CACHE_DIR"] = str(base / version)
            return


def _is_own_folder(folder: Path) -> bool:
    """Make a folder; whether it can be written, and by nobody else: what lies there is run."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        folder.mkdir(exist_ok=True)
        status = folder.parent.lstat()
    except OSError:
        return False
    private = stat.S_ISDIR(status.st_mode) and not status.st_mode & stat.S_IWOTH
    return private and status.st_uid == os.geteuid() and os.access(folder, os.W_OK | os.X_OK)


def is_cached(kernel: Any) -> bool:
    """Tell whether a numba kernel was compiled before, by this version for this kind of processor."""
    try:
        cache = kernel._cache
        index = Path(cache.cache_path, cache._cache_file._index_name)
        # its index is written first
        return index.exists() and any(index.parent.glob(f"{index.stem}*.nbc"))
    except AttributeError:  # another numba
        return True

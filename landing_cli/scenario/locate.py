"""Where a scenario file is found, and how its text is read: regular files of a bounded size only."""

from __future__ import annotations

import difflib
import importlib.resources
import os
import sys
from dataclasses import dataclass
from pathlib import Path

from landing_cli.errors import InputRefused
from landing_cli.sources.guarded_file import open_regular

MAX_BYTES = 1 << 20
STDIN = "-"


@dataclass(frozen=True)
class FoundScenario:
    """A scenario's file: ``path`` is None for standard input."""

    name: str
    path: Path | None
    beside: Path


def search_folders() -> list[Path]:
    """Folders in which a bare name is searched, in this order; absent ones are left out."""
    package = Path(str(importlib.resources.files("landing_cli")))
    roots = [Path("configs")]
    if (package.parent / "pyproject.toml").is_file():
        roots.append(package.parent / "configs")
    roots.append(package / "data" / "configs")
    folders = [Path(), *(folder for root in roots for folder in (root, root / "published"))]
    return [folder for folder in folders if folder.is_dir()]


def locate(source: str) -> FoundScenario:
    """Find a scenario by path, bare name (with or without ``.yaml``), or ``-``.

    Parameters
    ----------
    source : str
        As the user wrote it.

    Returns
    -------
    FoundScenario

    Raises
    ------
    InputRefused
        There is no such file; the message lists where it was searched and what is there.
    """
    if source == STDIN:
        return FoundScenario("standard input", None, Path())
    if not source or "\0" in source:
        raise InputRefused("the scenario's name is empty or holds a zero byte")
    bare = os.sep not in source
    names = [source] if source.endswith((".yaml", ".yml")) else [source, f"{source}.yaml"]
    candidates = [folder / name for folder in (search_folders() if bare else [Path()]) for name in names]
    existing = [path for path in candidates if _exists(path)]
    if not existing:
        raise _not_found(source, bare)
    path = next((path for path in existing if not path.is_dir()), existing[0])
    return FoundScenario(str(path), path, path.parent)


def read_text(found: FoundScenario) -> str:
    """Read a scenario's text: at most 1 MiB of UTF-8 from a regular file or standard input.

    Parameters
    ----------
    found : FoundScenario
        What `locate` found.

    Returns
    -------
    str
        Without the byte-order mark, if there was one.

    Raises
    ------
    InputRefused
        Not a regular file, too large, unreadable, or not UTF-8.
    """
    try:
        data = sys.stdin.buffer.read(MAX_BYTES + 1) if found.path is None else _read_regular(found.path)
    except (OSError, AttributeError) as error:
        reason = getattr(error, "strerror", None) or "it is closed"
        raise InputRefused(f"cannot be read: {reason}", where=found.name) from None
    if len(data) > MAX_BYTES:
        raise InputRefused(
            "holds more than 1 MiB",
            where=found.name,
            fix="a scenario is a few kB of YAML: is this the right file?",
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputRefused(
            f"byte 0x{data[error.start]:02x} is not UTF-8",
            where=f"{found.name}:{line}",
            fix="save the file as UTF-8",
        ) from None


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:
        return False


def _read_regular(path: Path) -> bytes:
    with open_regular(path, MAX_BYTES) as file:
        return file.read(MAX_BYTES + 1)


def _not_found(source: str, bare: bool) -> InputRefused:
    if not bare:
        return InputRefused("no such file", where=source, fix="give a path, a bare name, or - for stdin")
    folders = search_folders()
    present = sorted({path.name for folder in folders[1:] for path in folder.glob("*.yaml")})
    close = difflib.get_close_matches(source, present, n=1) or difflib.get_close_matches(
        f"{source}.yaml", present, n=1
    )
    searched = ", ".join(str(folder) for folder in folders)
    hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(present) or 'none there'}"
    return InputRefused(f"no such scenario in {searched}", where=source, fix=hint)

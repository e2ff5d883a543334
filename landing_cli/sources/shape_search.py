"""Where a shape is found that a scenario or a command names."""

from __future__ import annotations

import difflib
import importlib.resources
import os
from pathlib import Path

from landing_cli.errors import InputRefused

REFERENCE_VARIABLE = "LANDING_REFERENCE_DATA"
SUFFIXES = (".obj", ".tab", ".txt")


def shape_folders(beside: Path | None = None) -> list[Path]:
    """List the folders in which shapes are looked for, in this order.

    Parameters
    ----------
    beside : Path, optional
        Folder of the scenario that names the shape.

    Returns
    -------
    list of Path
        Beside the scenario, ``.``, ``./shapes``, the reference data where LANDING_REFERENCE_DATA is set,
        the checkout's ``shapes``, the installed package's. They need not exist.
    """
    package = Path(str(importlib.resources.files("landing_cli")))
    reference = os.environ.get(REFERENCE_VARIABLE)
    folders = [
        *([beside] if beside is not None else []),
        Path(),
        Path("shapes"),
        *([Path(reference) / "shapes"] if reference else []),
        *([package.parent / "shapes"] if (package.parent / "pyproject.toml").is_file() else []),
        package / "data" / "shapes",
    ]
    return list({_resolved(folder): folder for folder in reversed(folders)}.values())[::-1]


def _resolved(folder: Path) -> Path:
    try:
        return folder.resolve()
    except (OSError, RuntimeError):
        return folder


def find_shape(name: str, beside: Path | None = None) -> Path:
    """Find a shape file.

    Parameters
    ----------
    name : str
        A path, absolute or relative to one of the folders; ``.obj`` may be left out.
    beside : Path, optional
        Folder of the scenario that names the shape; searched first.

    Returns
    -------
    Path

    Raises
    ------
    InputRefused
        If it is nowhere; the message lists where it was looked for, and names like it.
    """
    if not name or "\0" in name:
        raise InputRefused("the name of a shape is empty or holds a zero byte", where=repr(name))
    folders = [Path()] if Path(name).is_absolute() else shape_folders(beside)
    for folder in folders:
        for candidate in (folder / name, folder / f"{name}.obj"):
            if _is_there(candidate):
                return candidate
    looked = ", ".join(str(_resolved(folder)) for folder in folders)
    known = sorted({path.name for path in known_shapes(beside)})
    close = difflib.get_close_matches(Path(name).name, known, n=3, cutoff=0.4)
    hint = f"did you mean {' or '.join(close)}?" if close else f"there are {', '.join(known) or 'none there'}"
    if Path(name).is_absolute():
        raise InputRefused("no such shape file", where=name, fix=hint)
    fix = hint if os.environ.get(REFERENCE_VARIABLE) else f"{hint} ({REFERENCE_VARIABLE} is not set)"
    raise InputRefused(f"no such shape in {looked}", where=name, fix=fix)


def _is_there(path: Path) -> bool:
    # A directory counts only where nothing else could be meant: the reader then says what it is.
    try:
        return path.exists() and (not path.is_dir() or path.is_absolute())
    except OSError:
        return False


def known_shapes(beside: Path | None = None) -> list[Path]:
    """List the shape files in the folders of :func:`shape_folders`, each once.

    Parameters
    ----------
    beside : Path, optional
        Folder to look in first.

    Returns
    -------
    list of Path
    """
    found: dict[Path, Path] = {}
    for folder in shape_folders(beside):
        suffixes = SUFFIXES if folder.name == "shapes" else SUFFIXES[:1]
        try:
            paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in suffixes)
        except OSError:
            continue
        for path in paths:
            found.setdefault(_resolved(path), path)
    return list(found.values())

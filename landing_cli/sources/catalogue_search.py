"""Where a catalogue is found that a scenario or a command names."""

from __future__ import annotations

import os
from pathlib import Path

from landing_cli.errors import InputRefused
from landing_cli.sources.shape_search import REFERENCE_VARIABLE

FOLDER = "catalog"


def catalogue_folders(beside: Path | None = None) -> list[Path]:
    """List the folders in which catalogues are looked for, in this order.

    Parameters
    ----------
    beside : Path, optional
        Folder of the scenario that names the catalogue.

    Returns
    -------
    list of Path
        Beside the scenario, ``.``, ``./catalog``, and the reference data where LANDING_REFERENCE_DATA is
        set. They need not exist.
    """
    reference = os.environ.get(REFERENCE_VARIABLE)
    folders = [
        *([beside] if beside is not None else []),
        Path(),
        Path(FOLDER),
        *([Path(reference) / FOLDER] if reference else []),
    ]
    return list(dict.fromkeys(folders))


def find_catalogue(name: str, beside: Path | None = None) -> Path:
    """Find a catalogue file.

    Parameters
    ----------
    name : str
        A path, absolute or relative to one of the folders.
    beside : Path, optional
        Folder of the scenario that names it; searched first.

    Returns
    -------
    Path

    Raises
    ------
    InputRefused
        If it is nowhere; the message lists where it was looked for.
    """
    if not name or "\0" in name:
        raise InputRefused("the name of a catalogue is empty or holds a zero byte", where=repr(name))
    folders = [Path()] if Path(name).is_absolute() else catalogue_folders(beside)
    for folder in folders:
        path = folder / name
        try:
            if path.exists():
                return path
        except OSError:
            continue
    if Path(name).is_absolute():
        raise InputRefused("no such catalogue", where=name, fix="`landing tour fetch` downloads one")
    looked = ", ".join(str(folder.absolute()) for folder in folders)
    unset = "" if os.environ.get(REFERENCE_VARIABLE) else f" ({REFERENCE_VARIABLE} is not set)"
    raise InputRefused(
        f"no such catalogue in {looked}{unset}",
        where=name,
        fix="take liu2023, the one that is shipped, or download one with `landing tour fetch`",
    )

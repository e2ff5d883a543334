"""The file of landmarks as a part of what a run is: found beside the scenario, known by its hash."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

from landing_cli.errors import InputRefused
from landing_cli.scenario.load import LoadedScenario
from landing_cli.scenario.messages import Problem, refusal
from landing_cli.scenario.schema_observe import LandmarksSection
from landing_cli.scenario.sections import observe_section
from landing_cli.sources.guarded_file import open_regular

LARGEST_BYTES = 64 * 2**20


def landmarks_path(loaded: LoadedScenario, section: LandmarksSection) -> Path:
    """Return where the landmarks' file lies: beside the scenario unless its path is absolute.

    Parameters
    ----------
    loaded : LoadedScenario
        The scenario.
    section : LandmarksSection
        Naming a file.
    """
    assert section.file is not None
    return loaded.beside / section.file


def with_landmarks_hash(loaded: LoadedScenario) -> LoadedScenario:
    """Write the hash of the landmarks' file into the scenario, so that another file is another run.

    Parameters
    ----------
    loaded : LoadedScenario
        With an ``observe`` section.

    Returns
    -------
    LoadedScenario
        The same where the landmarks are drawn.

    Raises
    ------
    InputRefused
        The file cannot be read, or is not the one that the scenario means.
    """
    section = observe_section(loaded)
    if section.landmarks.file is None:
        return loaded
    path = landmarks_path(loaded, section.landmarks)
    try:
        with open_regular(path, LARGEST_BYTES) as file:
            sha256 = hashlib.sha256(file.read()).hexdigest()
    except InputRefused as error:
        fix = error.fix or "name a file beside the scenario"
        raise _refused(loaded, "file", f"{error.where}: {error.what}", fix) from error
    if section.landmarks.sha256 not in (None, sha256):
        fix = "restore the file, or leave sha256 out"
        raise _refused(loaded, "sha256", f"{path.name} has the hash {sha256}", fix)
    landmarks = section.landmarks.model_copy(update={"sha256": sha256})
    observe = section.model_copy(update={"landmarks": landmarks})
    return replace(loaded, scenario=loaded.scenario.model_copy(update={"observe": observe}))


def _refused(loaded: LoadedScenario, key: str, what: str, fix: str) -> InputRefused:
    problem = Problem(("observe", "landmarks", key), what, fix)
    return refusal([problem], loaded.places, loaded.source)

"""What is wrong with a scenario, in words: one line a problem, with its place, key, value and fix."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from landing_cli.errors import InputRefused

KeyPath = tuple[str | int, ...]
MAX_PROBLEMS = 10


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong, at one key."""

    path: KeyPath
    what: str
    fix: str = ""


def dotted(path: KeyPath) -> str:
    """Write a key path as users do: ``reach.initial_states.0.name``."""
    return ".".join(str(part) for part in path)


def shown(value: object) -> str:
    """Show a value that was found, shortened and without control characters."""
    if isinstance(value, dict):
        return f"a section with {', '.join(map(str, list(value)[:4])) or 'nothing'}"
    if value is None:
        return "nothing"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def refusal(problems: Sequence[Problem], places: Mapping[KeyPath, str], source: str) -> InputRefused:
    """Put problems into one error.

    Parameters
    ----------
    problems : sequence of Problem
        At least one.
    places : mapping
        "file:line" of every key path that was written.
    source : str
        The file's name, for keys that stand nowhere.

    Returns
    -------
    InputRefused
    """
    errors = [_single(problem, places, source) for problem in problems[:MAX_PROBLEMS]]
    if len(errors) == 1:
        return errors[0]
    lines = [f"  {error}" for error in errors]
    if len(problems) > MAX_PROBLEMS:
        lines.append(f"  and {len(problems) - MAX_PROBLEMS} more")
    return InputRefused("\n".join([f"{len(problems)} problems", *lines]), where=source)


def did_you_mean(word: str, allowed: Sequence[str]) -> str:
    """Suggest the nearest allowed word, or list them all."""
    close = difflib.get_close_matches(word.lower(), allowed, n=1, cutoff=0.6)
    return f"did you mean {close[0]}?" if close else f"allowed here: {', '.join(allowed)}"


def place_of(path: KeyPath, places: Mapping[KeyPath, str], source: str) -> str:
    """Return the place of a key, of what is written beneath it, or of the nearest section around it."""
    if path not in places:
        beneath = [place for other, place in places.items() if other[: len(path)] == path]
        if beneath:
            return beneath[0]
    for end in range(len(path), -1, -1):
        if path[:end] in places:
            return places[path[:end]]
    return source


def _single(problem: Problem, places: Mapping[KeyPath, str], source: str) -> InputRefused:
    place = place_of(problem.path, places, source)
    where = f"{place}: {dotted(problem.path)}" if problem.path else place
    return InputRefused(problem.what, where=where, fix=problem.fix)

"""Words of a stored group, checked as they are read."""

from __future__ import annotations

from typing import Any

from landing_cli.results.tree import Group


def text(group: Group, name: str) -> str:
    """Return a text that is an attribute.

    Parameters
    ----------
    group : Group
        Where it stands.
    name : str
        Of the attribute.

    Raises
    ------
    KeyError, ValueError
        If there is none.
    """
    value = group.attributes[name]
    if not isinstance(value, str):
        raise ValueError(f"{name} is no text")
    return value


def choice(word: str, allowed: tuple[str, ...]) -> Any:
    """Return a word that is one of a few.

    Parameters
    ----------
    word : str
        As it was read.
    allowed : tuple of str
        The words.

    Raises
    ------
    ValueError
        If it is none of them.
    """
    if word not in allowed:
        raise ValueError(f"'{word}' is none of {', '.join(allowed)}")
    return word

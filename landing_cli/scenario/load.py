"""A scenario from a file or a name, with overrides, checked against the schema."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from landing_cli.errors import InputRefused, UsageError
from landing_cli.scenario.document import Document, Tree, parse
from landing_cli.scenario.locate import locate, read_text
from landing_cli.scenario.messages import KeyPath, dotted, shown
from landing_cli.scenario.schema import (
    AnyScenario,
    Scenario,
    from_tree,
    is_tour,
    tour_from_tree,
)
from landing_cli.scenario.schema_tour import TourScenario

S = TypeVar("S", bound=AnyScenario, covariant=True)


@dataclass(frozen=True)
class Loaded(Generic[S]):
    """A checked scenario and where it came from.

    Attributes
    ----------
    scenario : Scenario or TourScenario
    source : str
        The file that was read, as it is named to the user.
    beside : Path
        The folder where its shape or its catalogue is searched first.
    places : mapping
        "file:line" of every key that was written, by key path; for messages.
    """

    scenario: S
    source: str
    beside: Path
    places: Mapping[KeyPath, str]


LoadedScenario = Loaded[Scenario]
LoadedTour = Loaded[TourScenario]


def load(source: str, overrides: Sequence[str] = ()) -> LoadedScenario:
    """Read, override and check one scenario.

    Parameters
    ----------
    source : str
        A path, ``-`` for standard input, or a bare name that is searched in ``.``, ``./configs``,
        the checkout and the installed package.
    overrides : sequence of str
        ``dotted.key=value`` each; list elements are counted from 0.

    Returns
    -------
    LoadedScenario

    Raises
    ------
    InputRefused
        The file cannot be read safely, or what it says is wrong; every problem is named with its
        file, line and dotted key.
    """
    found = locate(source)
    return load_document(parse(read_text(found), found.name), found.name, found.beside, overrides)


def load_tour(source: str, overrides: Sequence[str] = ()) -> LoadedTour:
    """Read, override and check the scenario of a flyby tour.

    Parameters
    ----------
    source : str
        As for `load`.
    overrides : sequence of str
        ``dotted.key=value`` each.

    Returns
    -------
    LoadedTour

    Raises
    ------
    InputRefused
        The file cannot be read safely, what it says is wrong, or it is of a landing.
    """
    found = locate(source)
    document = _overridden(parse(read_text(found), found.name), overrides)
    scenario = tour_from_tree(document.tree, document.places, found.name)
    return Loaded(scenario, found.name, found.beside, document.places)


def load_any(source: str, overrides: Sequence[str] = ()) -> LoadedScenario | LoadedTour:
    """Read, override and check a scenario of either kind.

    Parameters
    ----------
    source : str
        As for `load`.
    overrides : sequence of str
        ``dotted.key=value`` each.

    Returns
    -------
    LoadedScenario or LoadedTour

    Raises
    ------
    InputRefused
        The file cannot be read safely, or what it says is wrong.
    """
    found = locate(source)
    document = _overridden(parse(read_text(found), found.name), overrides)
    if is_tour(document.tree):
        tour = tour_from_tree(document.tree, document.places, found.name)
        return Loaded(tour, found.name, found.beside, document.places)
    landing = from_tree(document.tree, document.places, found.name)
    return Loaded(landing, found.name, found.beside, document.places)


def load_document(
    document: Document, source: str, beside: Path, overrides: Sequence[str] = (), option: str = "--set"
) -> LoadedScenario:
    """Override and check the values of a scenario that were read already.

    Parameters
    ----------
    document : Document
        Its values and their places.
    source : str
        What to call it in messages.
    beside : Path
        The folder where its shape is searched first.
    overrides : sequence of str
        ``dotted.key=value`` each.
    option : str
        The command-line option that they came from; for messages.

    Returns
    -------
    LoadedScenario

    Raises
    ------
    InputRefused
        What it says is wrong.
    """
    document = _overridden(document, overrides, option)
    scenario = from_tree(document.tree, document.places, source)
    return Loaded(scenario, source, beside, document.places)


def read_document(source: str, overrides: Sequence[str] = ()) -> tuple[Document, str, Path]:
    """Read the values of a scenario that is overridden and checked later, more than once perhaps.

    Parameters
    ----------
    source : str
        As for `load`.
    overrides : sequence of str
        ``dotted.key=value`` each.

    Returns
    -------
    Document
        Its values with the overrides; unchecked.
    str
        What to call it in messages.
    Path
        The folder where its shape is searched first.

    Raises
    ------
    InputRefused
        The file cannot be read safely.
    """
    found = locate(source)
    document = _overridden(parse(read_text(found), found.name), overrides)
    return document, found.name, found.beside


def _overridden(document: Document, overrides: Sequence[str], option: str = "--set") -> Document:
    for override in overrides:
        document = _with_override(document, override, option)
    return document


def _with_override(document: Document, override: str, option: str) -> Document:
    """Put one ``key=value`` of the command line into the values."""
    key, separator, text = override.partition("=")
    if not separator or not key:
        raise UsageError(
            f"{option} {shown(override)} is not of the form key=value",
            fix=f"for instance {option} reach.tof_s=900",
        )
    origin = f"{option} {override if len(override) <= 80 else override[:77] + '...'}"
    try:
        value = parse(text, origin).tree if text.strip() else None
    except InputRefused as error:
        raise InputRefused(error.what, where=origin, fix=error.fix) from None
    tree, path = _replaced(document.tree, key.split("."), value, (), origin)
    places = {p: place for p, place in document.places.items() if p[: len(path)] != path}
    return Document(tree, {**places, path: origin})


def _replaced(
    node: Tree, parts: Sequence[str], value: Tree, path: KeyPath, origin: str
) -> tuple[Tree, KeyPath]:
    """Copy a tree with one value replaced; return it with the path that was written."""
    if not parts:
        return value, path
    head, rest = parts[0], parts[1:]
    if isinstance(node, list):
        if not (head.isascii() and head.isdigit() and len(head) < 9 and int(head) < len(node)):
            raise InputRefused(
                f"{shown(head)} is no element of {dotted(path)}",
                where=origin,
                fix=f"elements are counted from 0 to {len(node) - 1}" if node else "the list is empty",
            )
        index = int(head)
        child, written = _replaced(node[index], rest, value, (*path, index), origin)
        return [*node[:index], child, *node[index + 1 :]], written
    if node is None:
        node = {}
    if not isinstance(node, dict):
        raise InputRefused(f"{dotted(path)} is a single value, without keys of its own", where=origin)
    child, written = _replaced(node.get(head), rest, value, (*path, head), origin)
    return {**node, head: child}, written

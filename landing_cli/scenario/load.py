"""A scenario file, read with suspicion: the only place that knows YAML.

The text is walked event by event, so that nothing is built before it is known to be harmless:
no aliases, anchors, tags or merge keys, no duplicate keys, one document, bounded size, depth and
number of values. Plain scalars follow the YAML 1.2 core schema: ``1e3`` is a number, ``4:17`` and
``on`` are text.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import yaml

from landing_cli.errors import InputRefused, UsageError
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

MAX_DEPTH = 16
MAX_VALUES = 20_000
MAX_TEXT = 4_000
MAX_INT_DIGITS = 18

# the C parser reads a file of the largest size in milliseconds; the Python one is its stand-in
_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

_NULL = re.compile(r"(?:null|Null|NULL|~|)")
_TRUE = re.compile(r"(?:true|True|TRUE)")
_FALSE = re.compile(r"(?:false|False|FALSE)")
_INT = re.compile(r"[-+]?[0-9]+")
_OCTAL = re.compile(r"0o[0-7]+")
_HEX = re.compile(r"0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"(?:[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))")

Scalar = str | int | float | bool | None
Tree = Any  # dict[str, Tree] | list[Tree] | Scalar


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


@dataclass(frozen=True)
class Document:
    """The values of one YAML text, and the place ("file:line") each of them stands at."""

    tree: Tree
    places: dict[KeyPath, str]


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


def parse(text: str, name: str) -> Document:
    """Read one YAML text into plain values.

    Parameters
    ----------
    text : str
        The whole file.
    name : str
        What to call the text in messages.

    Returns
    -------
    Document

    Raises
    ------
    InputRefused
        The text is not the plain YAML that scenarios are written in.
    """
    _refuse_tabs_and_directives(text, name)
    loader = _Loader(text)
    try:
        return _Reader(loader, name).document()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else 1
        what = " ".join(part for part in (error.context, error.problem) if part)
        raise InputRefused(f"not readable as YAML: {what}", where=f"{name}:{line}") from None
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, max(0, int(error.position))) + 1
        raise InputRefused(
            "holds a character that YAML does not allow",
            where=f"{name}:{line}",
            fix="remove control characters",
        ) from None
    finally:
        loader.dispose()


def parse_scalar(text: str) -> Scalar:
    """Read a plain scalar by the YAML 1.2 core schema.

    Parameters
    ----------
    text : str
        As it stands in the file, unquoted.

    Returns
    -------
    None, bool, int, float or str

    Raises
    ------
    ValueError
        The number is not finite, or an integer has more than 18 digits.
    """
    if _NULL.fullmatch(text):
        return None
    if _TRUE.fullmatch(text):
        return True
    if _FALSE.fullmatch(text):
        return False
    if _NOT_FINITE.fullmatch(text):
        raise ValueError(f"{text} is not a finite number")
    for pattern, base in ((_INT, 10), (_OCTAL, 8), (_HEX, 16)):
        if pattern.fullmatch(text):
            if len(text) > MAX_INT_DIGITS + 2:
                raise ValueError(f"{shown(text)} is larger than any quantity here")
            return int(text, base)
    if len(text) <= 100 and _FLOAT.fullmatch(text):
        value = float(text)
        if value in (float("inf"), float("-inf")):
            raise ValueError(f"{text} is not a finite number")
        return value
    return text


class _Reader:
    """Builds plain values from the parser's events, refusing what a scenario never needs."""

    def __init__(self, loader: Any, name: str) -> None:
        self._loader = loader
        self._name = name
        self._values = 0
        self._places: dict[KeyPath, str] = {}

    def document(self) -> Document:
        events = self._events()
        next(events)  # stream start
        if isinstance(next(events), yaml.StreamEndEvent):
            raise InputRefused(
                "the file is empty", where=self._name, fix="`landing scenario init` writes one to start from"
            )
        tree = self._node(next(events), events, ())
        next(events)  # document end
        event = next(events)
        if not isinstance(event, yaml.StreamEndEvent):
            self._refuse(event, "holds a second document", "keep one scenario a file")
        return Document(tree, self._places)

    def _events(self) -> Iterator[Any]:
        while True:
            yield self._loader.get_event()

    def _refuse(self, event: Any, what: str, fix: str = "", path: KeyPath = ()) -> None:
        where = f"{self._name}:{event.start_mark.line + 1}"
        raise InputRefused(what, where=f"{where}: {dotted(path)}" if path else where, fix=fix)

    def _node(self, event: Any, events: Iterator[Any], path: KeyPath) -> Tree:
        self._values += 1
        if self._values > MAX_VALUES:
            self._refuse(event, f"holds more than {MAX_VALUES} values", "a scenario needs a few dozen")
        if len(path) > MAX_DEPTH:
            self._refuse(event, f"is nested deeper than {MAX_DEPTH} levels", "check the brackets")
        if isinstance(event, yaml.AliasEvent) or event.anchor is not None:
            self._refuse(event, "anchors and aliases (&, *) are not accepted", "write the value out", path)
        if event.tag is not None:
            self._refuse(event, f"the tag {shown(event.tag)} is not accepted", "write a plain value", path)
        self._places[path] = f"{self._name}:{event.start_mark.line + 1}"
        if isinstance(event, yaml.ScalarEvent):
            return self._scalar(event, path)
        if isinstance(event, yaml.SequenceStartEvent):
            return self._sequence(events, path)
        return self._mapping(events, path)

    def _scalar(self, event: Any, path: KeyPath) -> Scalar:
        text: str = event.value
        if len(text) > MAX_TEXT:
            self._refuse(event, f"a value of {len(text)} characters", f"at most {MAX_TEXT}", path)
        if not event.implicit[0]:
            return text
        try:
            return parse_scalar(text)
        except ValueError as error:
            self._refuse(event, str(error), "write a finite number of ordinary size", path)
            raise AssertionError from error

    def _sequence(self, events: Iterator[Any], path: KeyPath) -> list[Tree]:
        items: list[Tree] = []
        for event in events:
            if isinstance(event, yaml.SequenceEndEvent):
                break
            items.append(self._node(event, events, (*path, len(items))))
        return items

    def _mapping(self, events: Iterator[Any], path: KeyPath) -> dict[str, Tree]:
        items: dict[str, Tree] = {}
        for event in events:
            if isinstance(event, yaml.MappingEndEvent):
                break
            key = self._key(event, path)
            if key in items:
                first = self._places[(*path, key)].rpartition(":")[2]
                self._refuse(event, f"given twice (first in line {first})", "keep one of them", (*path, key))
            value = next(events)
            items[key] = self._node(value, events, (*path, key))
            # an empty or multi-line value is best found by its key
            self._places[(*path, key)] = f"{self._name}:{event.start_mark.line + 1}"
        return items

    def _key(self, event: Any, path: KeyPath) -> str:
        if not isinstance(event, yaml.ScalarEvent) or event.anchor is not None or event.tag is not None:
            self._refuse(event, "a key must be a plain word", "", path)
        key: str = event.value
        if key == "<<" and event.implicit[0]:
            self._refuse(event, "merge keys (<<) are not accepted", "write the keys out", path)
        if len(key) > MAX_TEXT:
            self._refuse(event, f"a key of {len(key)} characters", "", path)
        return key


def _refuse_tabs_and_directives(text: str, name: str) -> None:
    tab = re.search(r"^ *\t", text, re.MULTILINE)
    if tab:
        line = text.count("\n", 0, tab.start()) + 1
        raise InputRefused("indented with a tab", where=f"{name}:{line}", fix="indent with spaces")
    directive = re.search(r"^%", text, re.MULTILINE)
    if directive:
        line = text.count("\n", 0, directive.start()) + 1
        raise InputRefused(
            "YAML directives (%) are not accepted", where=f"{name}:{line}", fix="remove the line"
        )


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

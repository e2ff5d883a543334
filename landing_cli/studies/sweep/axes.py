"""The axes of a sweep: a scenario key and the values it takes, as `--over key=values` says them.

Values are texts, put into the scenario as `--set key=value` puts them; a range is counted in decimals, so
that its values are those that a user would write: 0.1:0.3:0.1 ends at 0.3, not at 0.30000000000000004.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import cached_property
from itertools import pairwise
from typing import TypeGuard

from landing_cli.errors import UsageError
from landing_cli.scenario.document import Scalar, parse_scalar
from landing_cli.scenario.messages import shown

MOST_VALUES = 5000
RESERVED = ("facet", "initial_state")

_DECIMAL = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,3})?"
_RANGE = re.compile(f"({_DECIMAL}):({_DECIMAL}):({_DECIMAL})")
_WORD = re.compile(r"[A-Za-z0-9_.+-]{1,64}")
_KEY = re.compile(r"[A-Za-z0-9_]+(?:\.[A-Za-z0-9_]+)+")
_FORMS = "for instance --over reach.tof_s=600:1200:50, or --over spacecraft.thrust_max_n=10,20,40"
# what a key's last words say of its unit
_UNITS = {
    "kg_m3": "kg m-3",
    "m3_s2": "m3 s-2",
    "rad_s": "rad s-1",
    "m_s": "m s-1",
    "deg": "degree",
    "km": "km",
    "kg": "kg",
    "s": "s",
    "n": "N",
    "h": "h",
    "m": "m",
}


@dataclass(frozen=True)
class Axis:
    """A key and the values it takes.

    Attributes
    ----------
    key : str
        Dotted scenario key.
    texts : tuple of str
        The values as ``--set`` would take them.
    name : str
        Of the dimension: the key's last word where that tells it from the other axes.
    """

    key: str
    texts: tuple[str, ...]
    name: str = ""

    @cached_property
    def values(self) -> tuple[float | str, ...]:
        """The values: numbers where all of them are, else texts."""
        found = [parse_scalar(text) for text in self.texts]
        numbers = [float(value) for value in found if _is_number(value)]
        return tuple(numbers) if len(numbers) == len(found) else self.texts

    @property
    def is_numeric(self) -> bool:
        """Whether every value is a number."""
        return isinstance(self.values[0], float)

    @property
    def units(self) -> str:
        """Unit of the values, as the key's name ends; 1 where it says none."""
        word = next((part for part in reversed(self.key.split(".")) if not part.isdigit()), "")
        ends = (unit for end, unit in _UNITS.items() if word.endswith(f"_{end}"))
        return next(ends, "1") if self.is_numeric else "1"

    def told(self) -> str:
        """Say the axis as ``--over`` takes it; the same for the same values."""
        return f"{self.key}={_as_range(self.texts) or ','.join(self.texts)}"


def parse_axis(text: str) -> Axis:
    """Read one ``key=values``.

    Parameters
    ----------
    text : str
        ``key=first:last:step`` (inclusive), or ``key=value,value,...``.

    Returns
    -------
    Axis
        Its key is not checked, and its name not given yet.

    Raises
    ------
    UsageError
        The text is of neither form, the range never ends, or fewer than two values are given.
    """
    where = f"--over {text if len(text) <= 80 else text[:77] + '...'}"
    key, separator, given = text.partition("=")
    if not separator or not given:
        raise UsageError("is not of the form key=values", where=where, fix=_FORMS)
    if not _KEY.fullmatch(key):
        raise UsageError(f"{shown(key)} is no dotted key", where=where, fix=_FORMS)
    found = _RANGE.fullmatch(given)
    texts = _counted(where, *map(Decimal, found.groups())) if found else _listed(where, given)
    if len(texts) < 2:
        raise UsageError("has one value: that is no sweep", where=where, fix=f"take --set {key}={texts[0]}")
    if len(texts) > MOST_VALUES:
        raise UsageError(f"has {len(texts)} values", where=where, fix=f"at most {MOST_VALUES}")
    axis = Axis(key, texts)
    first: dict[float | str, str] = {}
    for value, written in zip(axis.values, texts, strict=True):
        if value in first:
            told = f"{first[value]} and {written} are one value"
            raise UsageError(told, where=where, fix="give each value once")
        first[value] = written
    return axis


def named(axes: Sequence[Axis]) -> tuple[Axis, ...]:
    """Name axes by the last words of their keys, or by the whole key where that word is not theirs alone.

    Parameters
    ----------
    axes : sequence of Axis
        In the grid's order.

    Returns
    -------
    tuple of Axis

    Raises
    ------
    UsageError
        If two of them have the same key.
    """
    keys = [axis.key for axis in axes]
    twice = next((key for key in keys if keys.count(key) > 1), None)
    if twice is not None:
        raise UsageError("is swept twice", where=f"--over {twice}", fix="name each key once")
    words = [key.rpartition(".")[2] for key in keys]
    own = [not word.isdigit() and word not in RESERVED and words.count(word) == 1 for word in words]
    names = [word if alone else key for word, alone, key in zip(words, own, keys, strict=True)]
    return tuple(Axis(axis.key, axis.texts, name) for axis, name in zip(axes, names, strict=True))


def _counted(where: str, first: Decimal, last: Decimal, step: Decimal) -> tuple[str, ...]:
    if step == 0 or (last - first) * step < 0:
        fix = f"take a step of {'the other' if step else 'another'} sign" if step else "take another step"
        raise UsageError(f"steps of {step} never lead from {first} to {last}", where=where, fix=fix)
    if abs(last - first) / abs(step) >= MOST_VALUES:
        raise UsageError(f"has more than {MOST_VALUES} values", where=where, fix="take a longer step")
    count, rest = divmod(last - first, step)
    if rest:
        end = first + int(count) * step
        fix = f"they lead to {_plain(end)} and {_plain(end + step)}: name one of them"
        raise UsageError(f"steps of {step} from {first} miss {last}", where=where, fix=fix)
    return tuple(_plain(first + i * step) for i in range(int(count) + 1))


def _listed(where: str, given: str) -> tuple[str, ...]:
    texts = tuple(text.strip() for text in given.split(","))
    for text in texts:
        if not _WORD.fullmatch(text):
            told = f"{shown(text)} is neither a number nor a word" if text else "a value is empty"
            raise UsageError(told, where=where, fix=_FORMS)
        try:
            parse_scalar(text)
        except ValueError as error:
            raise UsageError(str(error), where=where, fix="write a finite number") from None
    return texts


def _as_range(texts: Sequence[str]) -> str:
    """Write three and more values with one step between them as a range; empty where they are none."""
    if len(texts) < 3 or not all(re.fullmatch(_DECIMAL, text) for text in texts):
        return ""
    values = [Decimal(text) for text in texts]
    step = values[1] - values[0]
    if not step or any(b - a != step for a, b in pairwise(values)):
        return ""
    return ":".join(map(_plain, (values[0], values[-1], step)))


def _plain(value: Decimal) -> str:
    """Write a decimal without exponent where that is short, and without idle zeros."""
    text = f"{value.normalize():f}"
    if len(text) > 24:
        return str(value.normalize())
    return "0" if text == "-0" else text


def _is_number(value: Scalar) -> TypeGuard[int | float]:
    return isinstance(value, int | float) and not isinstance(value, bool)

"""A scenario as YAML text: every key, with its value or default and what it means."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from landing_cli.scenario.schema import AnyScenario

# words that a YAML reader of any version takes as text
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*")
_NOT_TEXT = {"null", "true", "false", "yes", "no", "on", "off", "y", "n"}
COMMENT_COLUMN = 44


def to_yaml(scenario: AnyScenario, header: str = "") -> str:
    """Write a scenario as YAML that `load` reads back to the same scenario.

    Parameters
    ----------
    scenario : Scenario or TourScenario
        What to write.
    header : str
        Comment put at the top.

    Returns
    -------
    str
        Keys without a value stand as comments, so that a reader sees what else may be said.
    """
    lines = [f"# {line}".rstrip() for line in header.splitlines()]
    return "\n".join([*lines, *_section(scenario, "")]) + "\n"


def section_to_yaml(section: BaseModel) -> str:
    """Write one section of a scenario as YAML.

    Parameters
    ----------
    section : BaseModel
        What to write.

    Returns
    -------
    str
    """
    return "\n".join(_section(section, "")) + "\n"


def _section(section: BaseModel, indent: str) -> Iterator[str]:
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        comment = field.description or ""
        if isinstance(value, BaseModel):
            yield _line(f"{indent}{name}:", comment)
            yield from _section(value, indent + "  ")
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            yield _line(f"{indent}{name}:", comment)
            for item in value:
                first, *rest = _section(item, indent + "    ")
                yield f"{indent}  - {first[len(indent) + 4 :]}"
                yield from rest
        elif value is None:
            yield _line(f"{indent}# {name}:", comment)
        else:
            yield _line(f"{indent}{name}: {_value(value)}", comment)


def _line(text: str, comment: str) -> str:
    return f"{text:<{COMMENT_COLUMN - 1}} # {comment}" if comment else text


def _value(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        plain = _PLAIN.fullmatch(value) and value.lower() not in _NOT_TEXT
        return value if plain else json.dumps(value, ensure_ascii=False)
    return (
        f"{value:.17g}"
        if isinstance(value, float) and value == int(value) and abs(value) < 1e15
        else repr(value)
    )

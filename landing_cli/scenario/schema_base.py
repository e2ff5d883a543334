"""What every section of a scenario is made of: strictness, number types, contradictions."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag
from pydantic_core import PydanticCustomError

Number3 = tuple[float, float, float]
Positive3 = tuple[
    Annotated[float, Field(gt=0, le=1e9)],
    Annotated[float, Field(gt=0, le=1e9)],
    Annotated[float, Field(gt=0, le=1e9)],
]
Seconds = Annotated[float, Field(gt=0, le=1e7)]


def as_tuple(value: Any) -> Any:
    """Make a list, or a number that stands for a list of one, what a strict tuple accepts."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return (value,)
    return tuple(value) if isinstance(value, list) else value


def word_or_value(value: Any) -> str:
    """Tell which alternative of a key like ``auto | number`` a value belongs to."""
    return "word" if isinstance(value, str) else "value"


def word_value_or_range(value: Any) -> str:
    """Tell which alternative of a key like ``free | number | [least, most]`` a value belongs to."""
    return "range" if isinstance(value, list | tuple) else word_or_value(value)


Times = Annotated[
    tuple[Seconds, ...],
    Field(min_length=1, max_length=1000),
    BeforeValidator(as_tuple, json_schema_input_type=Seconds | list[Seconds]),
]
Auto = Annotated[Literal["auto"], Tag("word")]
FinalStage = Annotated[
    Annotated[Literal["free"], Tag("word")]
    | Annotated[Seconds, Tag("value")]
    | Annotated[tuple[Seconds, Seconds], Tag("range")],
    Discriminator(word_value_or_range),
]


class Section(BaseModel):
    """Strict, frozen, finite, and closed to unknown keys."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


def wrong(key: str, what: str, fix: str = "") -> PydanticCustomError:
    """Make the error of a contradiction between keys, told at one of them."""
    return PydanticCustomError("contradiction", "{what}", {"key": key, "what": what, "fix": fix})


def exactly_one(section: BaseModel, first: str, second: str) -> None:
    """Refuse a section that gives both of two keys, or neither."""
    given = [name for name in (first, second) if getattr(section, name) is not None]
    if len(given) == 2:
        raise wrong(second, f"stands beside {first}", "give one of them")
    if not given:
        raise wrong(first, "is missing", f"give {first} or {second}")

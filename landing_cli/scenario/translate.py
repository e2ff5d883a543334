"""The validator's findings, told in the user's words."""

from __future__ import annotations

from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from landing_cli.scenario.messages import KeyPath, Problem, did_you_mean, shown

_BOUNDS = {
    "greater_than": ("gt", "more than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}
_KINDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "string_type": "text",
    "bool_type": "true or false",
    "tuple_type": "a list",
    "list_type": "a list",
    "model_type": "a section of keys",
    "model_attributes_type": "a section of keys",
    "dict_type": "a section of keys",
}


def problems_of(error: ValidationError, model: type[BaseModel]) -> list[Problem]:
    """Translate a validation error.

    Parameters
    ----------
    error : ValidationError
        What the validator found.
    model : type of BaseModel
        What it was checked against.

    Returns
    -------
    list of Problem
        In the order of the file's sections.
    """
    found = [(_problem(detail, model), detail["type"]) for detail in error.errors(include_url=False)]
    paths = [problem.path for problem, _ in found]
    return [
        problem
        for problem, kind in found
        # a list whose element is refused counts as too short: that is not the user's mistake
        if not (kind == "too_short" and any(_beneath(other, problem.path) for other in paths))
    ]


def _beneath(path: KeyPath, parent: KeyPath) -> bool:
    return len(path) > len(parent) and path[: len(parent)] == parent


def _problem(detail: ErrorDetails, model: type[BaseModel]) -> Problem:
    path, section, field = _resolve(detail["loc"], model)
    kind, context = detail["type"], detail.get("ctx", {})
    value = detail.get("input")
    meaning = field.description or "" if field else ""
    if kind == "contradiction":
        parts = [part for part in str(context["key"]).split(".") if part]  # none: the key itself
        extra = tuple(int(part) if part.isdigit() else part for part in parts)
        return Problem((*path, *extra), str(context["what"]), str(context["fix"]))
    if kind == "missing":
        return Problem(path, "is missing", meaning)
    if kind == "extra_forbidden":
        return Problem(path, "is not a key here", did_you_mean(str(path[-1]), list(section.model_fields)))
    if kind == "literal_error":
        allowed = [str(word) for word in _choices(str(context.get("expected", "")))]
        return Problem(path, f"{shown(value)} is not allowed", _one_of(value, allowed))
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        allowed = _choices(str(context.get("expected_tags", ""))) or _tags(field)
        found = value.get("model") if isinstance(value, dict) else None
        if found is None:
            return Problem((*path, "model"), "is missing", f"allowed: {', '.join(allowed)}")
        return Problem((*path, "model"), f"{shown(found)} is not allowed", _one_of(found, allowed))
    if kind in _BOUNDS:
        bound, word = _BOUNDS[kind]
        return Problem(path, f"{shown(value)} is not {word} {context[bound]:g}", meaning)
    if kind in _KINDS:
        found = "is empty," if value is None else f"{shown(value)} is"
        return Problem(path, f"{found} not {_KINDS[kind]}", meaning)
    if kind in ("too_short", "too_long"):
        return Problem(path, _wrong_length(kind, context), meaning)
    if kind == "finite_number":
        return Problem(path, f"{shown(value)} is not a finite number", meaning)
    return Problem(path, f"{shown(value)} is not accepted", meaning)


def _resolve(
    loc: tuple[int | str, ...], model: type[BaseModel]
) -> tuple[KeyPath, type[BaseModel], FieldInfo | None]:
    """Strip the validator's own marks from a location; find its section and field."""
    path: list[str | int] = []
    section: type[BaseModel] = model
    field: FieldInfo | None = None
    for part in loc:
        if field is not None and isinstance(part, str):
            if part in ("word", "value", "range"):
                continue
            choices = _models(field.annotation)
            tagged = [m for m in choices if len(choices) > 1 and part in _words(m)]
            if tagged:
                section, field = tagged[0], None
                continue
            section = choices[0] if choices else section
        path.append(part)
        if isinstance(part, str):
            field = section.model_fields.get(part)
    return tuple(path), section, field


def _models(annotation: Any) -> list[type[BaseModel]]:
    """Sections that a field's annotation names, however deep."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models(part)]


def _tags(field: FieldInfo | None) -> list[str]:
    return [str(word) for m in _models(field.annotation) for word in _words(m)] if field else []


def _words(model: type[BaseModel]) -> tuple[Any, ...]:
    """Words that choose a section among its alternatives."""
    return get_args(model.model_fields["model"].annotation)


def _choices(text: str) -> list[str]:
    """Split the validator's "'a', 'b' or 'c'" into words."""
    return [word.strip().strip("'") for word in text.replace(" or ", ", ").split(",") if word.strip()]


def _one_of(value: Any, allowed: list[str]) -> str:
    if isinstance(value, str) and value in allowed:
        return "write it without quotes"
    if isinstance(value, str):
        hint = did_you_mean(value, allowed)
        if hint.startswith("did you mean"):
            return f"{hint} Allowed: {', '.join(allowed)}" if len(allowed) > 1 else hint
    return f"allowed: {', '.join(allowed)}"


def _wrong_length(kind: str, context: dict[str, Any]) -> str:
    actual = context.get("actual_length")
    found = f"has {actual} elements" if actual is not None else "has the wrong number of elements"
    if kind == "too_short":
        return f"{found}, at least {context['min_length']} needed"
    return f"{found}, at most {context['max_length']} allowed"

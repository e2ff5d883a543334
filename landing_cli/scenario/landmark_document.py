"""Lists of landmarks beside a scenario: CSV, or YAML under the rules that scenarios are read by."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from landing_cli.errors import InputRefused
from landing_cli.scenario.document import Document, parse
from landing_cli.sources.landmark_files import (
    LandmarkEntry,
    LandmarkTable,
    landmark_table,
    read_landmark_csv,
    read_landmark_text,
)

_KEYS = ("name", "position_m", "position_km", "lon_deg", "lat_deg", "diameter_m")


def read_landmarks(path: Path) -> LandmarkTable:
    """Read a list of landmarks.

    Parameters
    ----------
    path : Path
        ``.csv`` (see `landing_cli.sources.landmark_files.read_landmark_csv`) or ``.yaml``, ``.yml``: a list
        ``landmarks`` of mappings with ``position_m`` or ``position_km`` (three numbers, body frame), or
        ``lon_deg`` and ``lat_deg``, and where known ``name`` and ``diameter_m``.

    Returns
    -------
    LandmarkTable

    Raises
    ------
    InputRefused
        The file cannot be read safely, or is no such list; the line is named.
    """
    kind = path.suffix.lower()
    if kind == ".csv":
        return read_landmark_csv(path)
    if kind not in (".yaml", ".yml"):
        raise InputRefused(
            f"a list of landmarks does not end in {kind or 'nothing'}",
            where=str(path),
            fix="take .csv or .yaml",
        )
    text, sha256 = read_landmark_text(path)
    document = parse(text, str(path))
    entries = [_entry(document, index) for index in range(len(_list_of(document, path)))]
    return landmark_table(entries, sha256, str(path))


def _list_of(document: Document, path: Path) -> list[Any]:
    tree = document.tree
    if not isinstance(tree, dict) or set(tree) != {"landmarks"} or not isinstance(tree["landmarks"], list):
        raise InputRefused(
            "is not one list named landmarks",
            where=str(path),
            fix="begin it with `landmarks:` and a row `- ...`",
        )
    return tree["landmarks"]


def _entry(document: Document, index: int) -> LandmarkEntry:
    where = document.places["landmarks", index]
    node = document.tree["landmarks"][index]
    if not isinstance(node, dict):
        raise InputRefused("a landmark is no mapping", where=where, fix=f"write its {', '.join(_KEYS)}")
    for key in node:
        if key not in _KEYS:
            place = document.places["landmarks", index, key]
            raise InputRefused(
                f"{key[:40]!r} is no key of a landmark", where=place, fix=f"use {', '.join(_KEYS)}"
            )
    placed = {"position_m", "position_km"} & set(node)
    directed = {"lon_deg", "lat_deg"} & set(node)
    if len(placed) + (len(directed) == 2) != 1 or len(directed) == 1 or (placed and directed):
        raise InputRefused(
            "does not say where it is in one way",
            where=where,
            fix="give position_m, position_km, or lon_deg and lat_deg",
        )
    key = next(iter(placed), "")
    position = _three(node[key], f"{where}: {key}", 1000.0 if key == "position_km" else 1.0) if key else None
    direction = None
    if directed:
        direction = (
            _number(node["lon_deg"], f"{where}: lon_deg"),
            _number(node["lat_deg"], f"{where}: lat_deg"),
        )
    diameter = node.get("diameter_m")
    return LandmarkEntry(
        where=where,
        name=_name(node.get("name", ""), where),
        position_m=position,
        direction_deg=direction,
        diameter_m=None if diameter is None else _number(diameter, f"{where}: diameter_m"),
    )


def _three(value: Any, where: str, scale: float) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise InputRefused("is no list of three numbers", where=where, fix="write [x, y, z]")
    x, y, z = (scale * _number(item, where) for item in value)
    return x, y, z


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputRefused(f"{str(value)[:40]!r} is no number", where=where)
    return float(value)


def _name(value: Any, where: str) -> str:
    if not isinstance(value, str):
        raise InputRefused(f"name: {str(value)[:40]!r} is no text", where=where, fix="put it in quotes")
    return value

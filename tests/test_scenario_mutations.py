"""Every leaf of every shipped scenario, damaged in every way: exit 3, the dotted key, nothing left behind."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from scenario_samples import SHIPPED

from landing_cli.cli.guard import told
from landing_cli.cli.scenario import check
from landing_cli.errors import ExitCode
from landing_cli.scenario.load import parse

MISSING, MISSPELT = object(), object()
# values that may have either sign, and keys that may be left out
SIGNED = ("position_km", "position_m", "velocity_m_s", "azimuth_deg")
OPTIONAL = (
    "length_unit",
    "origin",
    "degree",
    "reference_radius_m",
    "propellant_kg",
    "velocity_m_s",
    "ellipsoid_m",
    "glide_slope_half_angle_deg",
    "handover",
    "descent",
    "final_stage_thrust",
    "method",
    "h_m",
    "azimuth_deg",
)
Path_ = tuple[str | int, ...]


def leaves(node: Any, path: Path_ = ()) -> Iterator[tuple[Path_, Any]]:
    if isinstance(node, dict):
        for key, value in node.items():
            yield from leaves(value, (*path, key))
    elif isinstance(node, list):
        for index, value in enumerate(node):
            yield from leaves(value, (*path, index))
    else:
        yield path, node


def mutations(path: Path_, value: Any) -> Iterator[tuple[str, Any]]:
    named = next(part for part in reversed(path) if isinstance(part, str))
    in_list = isinstance(path[-1], int)
    number = isinstance(value, int | float)
    yield "nan", "@.nan@"
    yield "infinite", "@-.inf@"
    yield "list", [[value]]
    yield "section", {"x": value}
    if number:
        yield "text", "plenty"
        yield "yes", True
        yield "huge", 1e300
        yield "sexagesimal", "4:17"
    else:
        yield "number", 3.5
        yield "misspelt value", f"{value}?"
    if number and value > 0 and named not in SIGNED:
        yield "sign", -value
        yield "zero", 0
    if not in_list:
        yield "misspelt", MISSPELT
    if not in_list and named not in OPTIONAL:
        yield "empty", None
        yield "missing", MISSING
    if in_list and named != "tof_s":
        yield "missing", MISSING


def mutated(tree: Any, path: Path_, change: Any) -> Any:
    tree = json.loads(json.dumps(tree))
    node = tree
    for part in path[:-1]:
        node = node[part]
    if change is MISSING:
        del node[path[-1]]
    elif change is MISSPELT:
        node[f"{path[-1]}_"] = node.pop(path[-1])
    else:
        node[path[-1]] = change
    return tree


def as_yaml(tree: Any) -> str:
    """One key a line, as people write it; JSON is YAML but for NaN."""
    return json.dumps(tree, indent=1).replace('"@', "").replace('@"', "")


def checked(_: Sequence[str]) -> int:
    """What `landing scenario check damaged.yaml --quiet` does once its arguments are parsed."""
    check("damaged.yaml", quiet=True)
    return ExitCode.OK


@pytest.mark.parametrize("source", SHIPPED, ids=lambda path: path.stem)
def test_every_damaged_leaf_is_refused_by_its_key(
    source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    tree = parse(source.read_text(), source.name).tree
    file = tmp_path / "damaged.yaml"
    tried = 0
    for path, value in leaves(tree):
        for kind, change in mutations(path, value):
            file.write_text(as_yaml(mutated(tree, path, change)))
            code = told(checked, [])
            out, err = capsys.readouterr()
            # what is wrong with a list's element may be told at the list
            key = ".".join(map(str, path[:-1] if isinstance(path[-1], int) else path))
            label = f"{kind} at {key}: exit {code}, {err}"
            assert code == ExitCode.REFUSED, label
            assert f": {key}" in err, label
            assert "damaged.yaml:" in err, label
            assert "Traceback" not in err, label
            assert "unexpected" not in err, label
            assert out == "", label
            tried += 1
    assert tried > 200
    assert [entry.name for entry in tmp_path.iterdir()] == ["damaged.yaml"]

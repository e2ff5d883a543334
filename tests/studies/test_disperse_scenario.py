"""The dispersion section: every contradiction is told at its key, and what is shown is read back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from dispersion_samples import SCENARIO, write_boulder
from test_disperse_draws import random_covariance

from landing_cli.cli.app import main
from landing_cli.errors import InputRefused
from landing_cli.scenario.load import load
from landing_cli.scenario.schema import from_tree, json_schema, to_tree
from landing_cli.scenario.sections import for_mission
from landing_cli.scenario.show import to_yaml
from landing_cli.studies.disperse.request import request_of

ROOT = Path(__file__).resolve().parent.parent.parent
COVARIANCE = random_covariance().tolist()


def tree_with(**section: Any) -> dict[str, Any]:
    return {
        "name": "probe",
        "body": {
            "shape": "boulder.obj",
            "rotation_period_h": 5,
            "gravity": {"model": "point_mass", "gm_m3_s2": 4.9},
        },
        "spacecraft": {"mass_kg": 1000, "thrust_max_n": 10, "isp_s": 300},
        "reach": {
            "initial_states": [{"name": "top", "position_m": [0, 0, 900]}],
            "tof_s": 700,
            "final_stage_s": 200,
        },
        "disperse": section,
    }


def changed(row: int, column: int, value: float, mirror: bool = True) -> list[list[float]]:
    matrix = [list(line) for line in COVARIANCE]
    matrix[row][column] = value
    if mirror:
        matrix[column][row] = value
    return matrix


@pytest.mark.parametrize(
    ("section", "told"),
    [
        ({"position_sigma_m": [1, 1, 1], "covariance": COVARIANCE}, "disperse.covariance: stands beside"),
        ({"thrust_sigma_n": 1, "thrust_sigma_relative": 0.1}, "disperse.thrust_sigma_relative: stands"),
        ({"gm_sigma_m3_s2": 1, "gm_sigma_relative": 0.1}, "disperse.gm_sigma_relative: stands beside"),
        ({"gm_sigma_relative": 0.2}, "disperse.gm_sigma_relative: 0.2 is not at most 0.1"),
        ({"position_sigma_m": [1, -1, 1]}, "disperse.position_sigma_m.1: -1 is not at least 0"),
        ({"position_sigma_m": [1, 1]}, "disperse.position_sigma_m"),
        ({"covariance": COVARIANCE[:5]}, "disperse.covariance"),
        ({"covariance": changed(2, 2, -1.0)}, "disperse.covariance.2.2: -1 is a negative variance"),
        ({"covariance": changed(3, 1, 0.5, mirror=False)}, "disperse.covariance.3.1: 0.5 is not"),
        ({"covariance": changed(1, 0, 1e4)}, "disperse.covariance: has a negative variance along"),
        ({"covariance": changed(0, 0, 0.0)}, "disperse.covariance.1.0"),
        ({"samples": 0}, "disperse.samples: 0 is not at least 1"),
        ({"seed": 1.5}, "disperse.seed"),
        ({"seed": -1}, "disperse.seed: -1 is not at least 0"),
        ({"confidence": 1.0}, "disperse.confidence: 1.0 is not at most 0.9999"),
        ({"axes": "inertial"}, "disperse.axes: 'inertial' is not allowed"),
        ({"cases": ["top"]}, "disperse.cases.0"),
        ({"cases": []}, "disperse.cases"),
        ({"position_sigma_km": [1, 1, 1]}, "disperse.position_sigma_km: is not a key here"),
    ],
)
def test_a_contradiction_is_told_at_its_key(section: dict[str, Any], told: str) -> None:
    with pytest.raises(InputRefused) as refused:
        from_tree(tree_with(**section))
    assert told in str(refused.value)


def test_a_sigma_wider_than_its_quantity_is_refused_with_the_body(tmp_path: Path) -> None:
    for key, value in (("thrust_sigma_n", 3), ("mass_sigma_kg", 300), ("gm_sigma_m3_s2", 0.6)):
        relative = key.split("_sigma")[0] + "_sigma_relative"
        text = "\n".join(line for line in SCENARIO.splitlines() if relative not in line)
        loaded = load(str(write_boulder(tmp_path, text)), [f"disperse.{key}={value}"])
        with pytest.raises(InputRefused, match=rf"disperse\.{key}: .* is more than a tenth"):
            request_of(loaded)


def test_absolute_and_relative_sigmas_say_the_same(tmp_path: Path) -> None:
    text = SCENARIO.replace("mass_sigma_relative: 0.005", "mass_sigma_kg: 10")
    text = text.replace("thrust_sigma_relative: 0.05", "thrust_sigma_n: 1")
    absolute = request_of(load(str(write_boulder(tmp_path, text)))).drawing.spread
    relative = request_of(load(str(write_boulder(tmp_path)))).drawing.spread
    assert absolute.sigmas.tolist() == relative.sigmas.tolist()


@pytest.mark.parametrize(
    "section", [{"covariance": COVARIANCE}, {"position_sigma_m": [1, 2, 3], "cases": ["top_700s"]}]
)
def test_what_is_shown_is_read_back(section: dict[str, Any], tmp_path: Path) -> None:
    scenario = from_tree(tree_with(**section))
    path = write_boulder(tmp_path, to_yaml(scenario))
    assert load(str(path)).scenario == scenario
    assert from_tree(to_tree(scenario)) == scenario


def test_other_missions_do_not_see_the_section() -> None:
    scenario = from_tree(tree_with(position_sigma_m=[1, 2, 3]))
    assert for_mission(scenario, "reach").disperse is None
    kept = for_mission(scenario, "reach", "disperse")
    assert (kept.reach, kept.disperse) == (scenario.reach, scenario.disperse)


def test_the_schema_and_the_shipped_scenario_know_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert "DisperseSection" in json_schema()["$defs"]
    loaded = load(str(ROOT / "configs" / "bennu.yaml"))
    assert loaded.scenario.disperse is not None
    assert main("landing", ["scenario", "show", str(ROOT / "configs" / "bennu.yaml")]) == 0
    assert "thrust_sigma_relative: 0.02" in capsys.readouterr().out
    assert main("landing", ["scenario", "check", str(ROOT / "configs" / "bennu.yaml")]) == 0
    assert "thrust 0.4, gm 0.04892" in " ".join(capsys.readouterr().out.split())

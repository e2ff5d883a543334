"""The axes of a sweep: exact ranges, lists, names, and what is refused before anything is computed."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest
from scenario_samples import MINIMAL, write_minimal

from landing_cli.cli.app import main
from landing_cli.errors import ExitCode, UsageError
from landing_cli.scenario.document import parse_scalar
from landing_cli.studies.sweep.axes import Axis, named, parse_axis


@pytest.mark.parametrize(
    ("given", "texts"),
    [
        ("600:1200:200", ("600", "800", "1000", "1200")),
        ("0.1:0.5:0.1", ("0.1", "0.2", "0.3", "0.4", "0.5")),
        ("40:10:-10", ("40", "30", "20", "10")),
        ("-1:1:1", ("-1", "0", "1")),
        ("1e3:1.2e3:100", ("1000", "1100", "1200")),
        ("10,20,40", ("10", "20", "40")),
        ("outside, on_ellipsoid", ("outside", "on_ellipsoid")),
    ],
)
def test_a_range_ends_where_it_says_and_a_list_is_taken_as_it_stands(
    given: str, texts: tuple[str, ...]
) -> None:
    assert parse_axis(f"reach.x={given}").texts == texts


@pytest.mark.parametrize(
    ("first", "step", "count"), [("0.1", "0.1", 300), ("0.7", "0.013", 500), ("1e-3", "1e-4", 99)]
)
def test_values_of_a_range_are_what_a_user_would_write(first: str, step: str, count: int) -> None:
    exact = [Fraction(first) + i * Fraction(step) for i in range(count)]
    axis = parse_axis(f"a.b={first}:{float(exact[-1])!r}:{step}")
    assert [Fraction(text) for text in axis.texts] == exact
    assert axis.values == tuple(float(value) for value in exact)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("reach.tof_s", "is not of the form key=values"),
        ("reach.tof_s=", "is not of the form key=values"),
        ("tof=1,2", "'tof' is no dotted key"),
        ("a.b=5", "has one value: that is no sweep; take --set a.b=5"),
        ("a.b=5:5:1", "has one value"),
        ("a.b=600:800:70", "steps of 70 from 600 miss 800; they lead to 740 and 810: name one of them"),
        ("a.b=1:2:-1", "steps of -1 never lead from 1 to 2; take a step of the other sign"),
        ("a.b=1:2:0", "steps of 0 never lead from 1 to 2"),
        ("a.b=0:1:1e-9", "has more than 5000 values"),
        ("a.b=1:2", "'1:2' is neither a number nor a word"),
        ("a.b=1,,2", "a value is empty"),
        ("a.b=1,[2]", "'[2]' is neither a number nor a word"),
        ("a.b=1,.nan", ".nan is not a finite number"),
        ("a.b=600,6e2", "600 and 6e2 are one value"),
    ],
)
def test_what_is_no_axis_is_refused(text: str, told: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse_axis(text)
    assert told in str(caught.value)
    assert "--over" in str(caught.value)


def test_an_axis_is_told_alike_however_it_was_written() -> None:
    as_list, as_range = parse_axis("a.b=0.10,0.20,0.3"), parse_axis("a.b=0.1:0.3:0.1")
    assert as_list.told() == as_range.told() == "a.b=0.1:0.3:0.1"
    assert parse_axis("a.b=10,20,40").told() == "a.b=10,20,40"
    assert parse_axis(as_range.told()).values == as_range.values


def test_names_tell_axes_apart() -> None:
    keys = ("reach.tof_s", "body.gravity.model", "reach.initial_states.0.position_m.2", "a.x", "b.x")
    axes = named([Axis(key, ("1", "2")) for key in keys])
    assert [axis.name for axis in axes] == ["tof_s", "model", keys[2], "a.x", "b.x"]
    assert [axis.units for axis in axes[:3]] == ["s", "1", "m"]
    with pytest.raises(UsageError, match=r"a\.x: is swept twice"):
        named([axes[3], axes[3]])


def test_words_and_numbers_together_are_words() -> None:
    axis = parse_axis("spacecraft.propellant_kg=null,100,200")
    assert axis.values == ("null", "100", "200")
    assert parse_scalar(axis.texts[0]) is None


def asked(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    code = main("reach", ["sweep", "probe", "--dry-run", *arguments])
    return code, *capsys.readouterr()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_minimal(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("over", "code", "told"),
    [
        ("reach.tof=1,2", ExitCode.REFUSED, "reach.tof: is not a key here; did you mean tof_s?"),
        ("spacecaft.mass_kg=1,2", ExitCode.REFUSED, "did you mean spacecraft?"),
        ("reach.handover=outside,on_elipsoid", ExitCode.REFUSED, "did you mean on_ellipsoid?"),
        ("reach.tof_s=100,700", ExitCode.REFUSED, "200 is not shorter than the time of flight of 100 s"),
        ("spacecraft.mass_kg=0,5", ExitCode.REFUSED, "--over spacecraft.mass_kg=0: spacecraft.mass_kg: 0 is"),
        ("plan.tof_s=1,2", ExitCode.USAGE, "changes nothing of what is reachable"),
        ("reach.method=traverse,section", ExitCode.USAGE, "changes nothing of what is reachable"),
        ("reach.section.azimuth_deg=0,90", ExitCode.USAGE, "changes nothing of what is reachable"),
        ("reach.initial_states.0.name=a,b", ExitCode.USAGE, "changes nothing of what is reachable"),
        ("body.shape=a.obj,b.obj", ExitCode.USAGE, "changes the surface"),
        ("body.length_unit=m,km", ExitCode.USAGE, "changes the surface"),
        ("reach.tof_s=201:5200:1", ExitCode.USAGE, ""),
    ],
)
def test_a_key_that_is_none_or_changes_nothing_is_refused(
    over: str, code: int, told: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(folder.rglob("*"))
    if not told:
        second = ("--over", "spacecraft.isp_s=300,400")
        found, out, err = asked(capsys, "--over", over, *second)
        assert "5000 x 2 = 10000 cells; at most 5000" in err
    else:
        found, out, err = asked(capsys, "--over", over)
        assert told in err
    assert (found, out) == (code, "")
    assert sorted(folder.rglob("*")) == before


def test_several_times_of_flight_are_an_axis_too(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = asked(capsys, "--over", "body.rotation_period_h=4,5")
    assert (code, err.splitlines()[0]) == (0, "read probe.yaml")
    assert out.splitlines()[2].split() == ["tof_s", "reach.tof_s", "2", "700,", "900"]
    assert out.splitlines()[-1] == "4 cells, 32 solves"
    code, out, _ = asked(capsys, "--over", "reach.tof_s=600:800:100", "--over", "spacecraft.isp_s=300,400")
    assert out.splitlines()[-1] == "6 cells, 48 solves"


def test_a_state_with_times_of_its_own_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = MINIMAL.replace("[0, 0, 900]}", "[0, 0, 900], tof_s: [650, 750]}")
    write_minimal(folder, text)
    code, _, err = asked(capsys, "--over", "spacecraft.isp_s=300,400", "--set", "reach.tof_s=700")
    assert code == ExitCode.REFUSED
    assert "initial state top has several times of flight of its own" in err


def test_a_sweep_without_an_axis_is_a_mistake_of_usage(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = asked(capsys)
    assert code == ExitCode.USAGE
    assert "a sweep needs an axis" in err

"""Reading a scenario's text: what is accepted, what is refused, and that refusing is cheap."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from scenario_samples import MINIMAL, SHIPPED, write_minimal

from landing_cli.errors import InputRefused, LandingError, UsageError
from landing_cli.scenario.document import MAX_DEPTH, parse, parse_scalar
from landing_cli.scenario.load import load

LEVELS = 100_000


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e3", 1000.0),
        ("4.4628e5", 446280.0),
        (".5", 0.5),
        ("-0", 0),
        ("017", 17),
        ("0o17", 15),
        ("0x1F", 31),
        ("4:17", "4:17"),
        ("on", "on"),
        ("yes", "yes"),
        ("True", True),
        ("~", None),
        ("", None),
        ("1_000", "1_000"),
        ("2029-04-13", "2029-04-13"),
        ("0b11", "0b11"),
        ("infinity", "infinity"),
        ("nan", "nan"),
    ],
)
def test_plain_scalars_follow_yaml_1_2(text: str, value: object) -> None:
    result = parse_scalar(text)
    assert result == value
    assert type(result) is type(value)


@pytest.mark.parametrize("text", [".nan", ".inf", "-.Inf", "1e999", "9" * 30, "0x" + "f" * 40])
def test_numbers_that_are_not_finite_or_huge_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"finite|larger"):
        parse_scalar(text)


@pytest.mark.parametrize(
    ("text", "line", "claim"),
    [
        ("a: 1\nb: &x 2\n", 2, "anchors"),
        ("a: 1\nb: *x\n", 2, "aliases"),
        ("a: !!python/object:os.system 1\n", 1, "tag"),
        ("a: !x 1\n", 1, "tag"),
        ("a: 1\n<<: {b: 2}\n", 2, "merge"),
        ("a: 1\nb: 2\na: 3\n", 3, "given twice (first in line 1)"),
        ("a: {b: 1, c: {d: 1, d: 2}}\n", 1, "given twice"),
        ("a: 1\n---\nb: 2\n", 2, "second document"),
        ("a:\n\tb: 1\n", 2, "tab"),
        ("%YAML 1.1\n---\na: 1\n", 1, "directives"),
        ("a: 1\nb: .nan\n", 2, "finite"),
        ("a: 1\nb: [1\nc: 2\n", 3, "not readable as YAML"),
        ("a: 1\n? [x, y]\n: 3\n", 2, "key must be a plain word"),
        ("a: 1\nb: \x07\n", 2, "character"),
        ("a: 'x\n", 2, "not readable as YAML"),
        ("", None, "empty"),
        ("# nothing\n", None, "empty"),
        ("a: " + "[" * LEVELS, 1, "nested deeper"),
        ("a: " + "{b: " * LEVELS, 1, "nested deeper"),
        ("- " * LEVELS, 1, "nested deeper"),
        ("a: [" + "1," * 30_000 + "1]\n", 1, "more than 20000 values"),
        ("a: " + "x" * 5000, 1, "5000 characters"),
    ],
)
def test_unsafe_or_broken_text_is_refused_with_its_line(text: str, line: int | None, claim: str) -> None:
    with pytest.raises(InputRefused) as caught:
        parse(text, "f.yaml")
    message = str(caught.value)
    assert claim in message
    assert "\n" not in message
    if line is not None:
        assert message.startswith(f"f.yaml:{line}:"), message


def test_a_duplicate_key_is_named_dotted() -> None:
    with pytest.raises(InputRefused, match=r"f\.yaml:3: a\.b: given twice"):
        parse("a:\n  b: 1\n  b: 2\n", "f.yaml")


def test_crlf_and_byte_order_mark_are_accepted(tmp_path: Path) -> None:
    path = write_minimal(tmp_path)
    expected = load(str(path)).scenario
    path.write_bytes(b"\xef\xbb\xbf" + MINIMAL.replace("\n", "\r\n").encode())
    assert load(str(path)).scenario == expected


@pytest.mark.parametrize(
    ("data", "claim"),
    [
        (MINIMAL.replace("probe", "süd").encode("latin-1"), ":1: byte 0xfc is not UTF-8"),
        (MINIMAL.encode("utf-16"), "is not UTF-8"),
        (b"name: x\n" + b"#" * (1 << 20), "1 MiB"),
        (b"name: \x00\n", ":1: "),
    ],
)
def test_wrong_encodings_and_sizes_are_refused(tmp_path: Path, data: bytes, claim: str) -> None:
    path = tmp_path / "s.yaml"
    path.write_bytes(data)
    with pytest.raises(InputRefused) as caught:
        load(str(path))
    assert claim in str(caught.value)
    assert "s.yaml" in str(caught.value)


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo.yaml")
    for source in (str(tmp_path), str(tmp_path / "fifo.yaml"), "/dev/zero", "/dev/tty"):
        began = time.monotonic()
        with pytest.raises(InputRefused):
            load(source)
        assert time.monotonic() - began < 1.0


def test_stdin_is_read_and_bounded(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(MINIMAL.encode())))
    assert load("-").source == "standard input"
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"#" * (2 << 20))))
    with pytest.raises(InputRefused, match="standard input: holds more than 1 MiB"):
        load("-")
    monkeypatch.setattr(sys, "stdin", None)
    with pytest.raises(InputRefused, match="standard input: cannot be read"):
        load("-")


def test_bare_names_are_found_anywhere_and_misspelt_ones_get_a_hint(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert load("bennu.yaml").source.endswith("configs/bennu.yaml")
    assert load("zhao2022-bennu").scenario.name == "zhao2022-bennu"
    (tmp_path / "configs").mkdir()
    write_minimal(tmp_path / "configs", name="bennu.yaml")
    assert load("bennu.yaml").source == "configs/bennu.yaml"
    write_minimal(tmp_path, name="bennu.yaml")
    assert load("bennu.yaml").source == "bennu.yaml"
    with pytest.raises(InputRefused, match=r"did you mean bacchus\.yaml\?"):
        load("bachus.yaml")
    with pytest.raises(InputRefused, match="no such file"):
        load("nowhere/bennu.yaml")


def test_overrides_reach_every_leaf_and_say_so_when_they_are_wrong(tmp_path: Path) -> None:
    path = str(write_minimal(tmp_path))
    reach = load(
        path, ["reach.tof_s.1=1e3", "reach.section.h_m=25", "reach.initial_states.0.name=up"]
    ).scenario.reach
    assert reach.tof_s == (700.0, 1000.0)
    assert reach.section.h_m == 25
    assert reach.initial_states[0].name == "up"
    swapped = load(path, ["body.gravity={model: dipole, gm_m3_s2: 1}", "name=x"]).scenario
    assert swapped.body.gravity.model == "dipole"
    for override, claim in [
        ("reach.tof_s=-3", "--set reach.tof_s=-3: reach.tof_s.0: -3 is not more than 0"),
        ("reach.tofs=3", "--set reach.tofs=3: reach.tofs: is not a key here; did you mean tof_s?"),
        ("reach.tof_s.7=3", "'7' is no element of reach.tof_s"),
        ("reach.final_stage_s.x=3", "reach.final_stage_s is a single value"),
        ("name=.nan", "--set name=.nan: .nan is not a finite number"),
        ("spacecraft=[1", "--set spacecraft=[1: not readable as YAML"),
    ]:
        with pytest.raises(InputRefused) as caught:
            load(path, [override])
        assert claim in str(caught.value)
    with pytest.raises(UsageError, match="key=value"):
        load(path, ["reach.tof_s"])


def test_an_alias_bomb_costs_nothing() -> None:
    bomb = "a: &a [x]\n" + "".join(
        f"{b}: &{b} [*{a}, *{a}, *{a}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
    )
    began = time.process_time()
    with pytest.raises(InputRefused, match="anchors"):
        parse(bomb, "bomb.yaml")
    assert time.process_time() - began < 0.1


@pytest.mark.parametrize(
    "kind", ["brackets", "braces", "dashes", "questions", "wide", "comment", "quoted", "directives", "keys"]
)
def test_a_full_mebibyte_costs_less_than_a_second_and_200_mb(kind: str, tmp_path: Path) -> None:
    unit = {
        "brackets": "[",
        "braces": "{a: ",
        "dashes": "- ",
        "questions": "? ",
        "wide": "- 1\n",
        "comment": "# x\n",
        "quoted": "'' ",
        "directives": "%TAG !a! b\n",
        "keys": "a: ",
    }[kind]
    path = tmp_path / "big.yaml"
    path.write_text(unit * ((1 << 20) // len(unit)))
    script = (
        "import resource, sys\n"
        "from landing_cli.scenario.load import load\n"
        "from landing_cli.errors import InputRefused\n"
        "before = resource.getrusage(resource.RUSAGE_SELF)\n"
        "try:\n    load(sys.argv[1])\nexcept InputRefused as error:\n    assert 'big.yaml' in str(error)\n"
        "else:\n    sys.exit('accepted')\n"
        "after = resource.getrusage(resource.RUSAGE_SELF)\n"
        "status = open('/proc/self/status').read()\n"  # ru_maxrss would count the test runner before exec
        "peak = status.split('VmHWM:')[1].split()[0]\n"
        "print(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, peak)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    cpu_s, peak_kb = map(float, done.stdout.split())
    assert cpu_s < 1.0
    assert peak_kb < 200_000


def test_the_depth_limit_is_what_it_says() -> None:
    assert parse("[" * (MAX_DEPTH + 1) + "]" * (MAX_DEPTH + 1), "deep.yaml").tree
    with pytest.raises(InputRefused, match="deeper than 16"):
        parse("[" * (MAX_DEPTH + 2) + "]" * (MAX_DEPTH + 2), "deep.yaml")


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    data=st.one_of(
        st.binary(max_size=300), st.text(max_size=300).map(lambda text: text.encode("utf-8", "ignore"))
    )
)
def test_any_bytes_are_a_scenario_or_a_refusal(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "fuzz.yaml"
    path.write_bytes(data)
    with pytest.raises(LandingError) as caught:
        load(str(path))
    assert "fuzz.yaml" in str(caught.value)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(position=st.integers(0, 10_000), piece=st.text(alphabet="[]{}:,-'\"&*!%#|>\t\n 0.eE~x", max_size=5))
def test_a_damaged_scenario_is_read_or_refused(tmp_path: Path, position: int, piece: str) -> None:
    text = SHIPPED[0].read_text()
    at = position % len(text)
    path = tmp_path / "fuzz.yaml"
    path.write_text(text[:at] + piece + text[at + len(piece) :])
    try:
        load(str(path))
    except LandingError as error:
        assert "fuzz.yaml" in str(error)

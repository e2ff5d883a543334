"""What is printed: tables for people and pipes, JSON without NaN, progress that says how long."""

from __future__ import annotations

import json

import numpy as np
import pytest

from landing_cli.cli import console


class Terminal:
    """A stream that claims to be a terminal."""

    def __init__(self) -> None:
        self.text = ""

    def write(self, text: str) -> int:
        self.text += text
        return len(text)

    def flush(self) -> None: ...

    def isatty(self) -> bool:
        return True


def test_a_table_in_a_pipe_is_aligned_plain_text(capsys: pytest.CaptureFixture[str]) -> None:
    console.print_table(
        ["case", "n", "x"], [["a", 10, 1.23456789], ["longer", 2, float("nan")], ["b", 3, None]]
    )
    assert capsys.readouterr().out.splitlines() == [
        "case     n       x",
        "a       10  1.2346",
        "longer   2       -",
        "b        3       -",
    ]


def test_a_table_on_a_terminal_is_ruled_and_shows_brackets_as_they_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stdout", terminal)
    console.print_table(["case"], [["[red]a[/red]"]], title="T")
    assert "[red]a[/red]" in terminal.text
    assert "─" in terminal.text


def test_json_has_null_for_nan_and_plain_numbers_for_numpy(capsys: pytest.CaptureFixture[str]) -> None:
    value = {
        "a": np.float64("nan"),
        "b": np.array([1.5, np.inf]),
        "c": np.int64(3),
        "d": (True, None),
        5: "é",
    }
    console.print_json(value)
    assert json.loads(capsys.readouterr().out) == {
        "a": None,
        "b": [1.5, None],
        "c": 3,
        "d": [True, None],
        "5": "é",
    }


def test_quiet_silences_remarks_but_not_warnings(capsys: pytest.CaptureFixture[str]) -> None:
    voice = console.Console(quiet=True)
    voice.say("remark")
    voice.warn("careful")
    with voice.progress("facets") as progress:
        progress(1, 2)
    assert capsys.readouterr() == ("", "warning: careful\n")


def test_progress_without_a_terminal_is_a_line_now_and_then(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = iter([100.0, 101.0, 110.0, 112.0, 180.0, 200.0])
    monkeypatch.setattr("landing_cli.cli.console.time.monotonic", lambda: next(clock))
    with console.Console().progress("facets") as progress:
        for done in (100, 200, 220, 1000, 7300):  # the first 100 were there already
            progress(done, 7300)
    assert capsys.readouterr().err.splitlines() == [
        "200/7300 facets",
        "1000/7300 facets, 11.47 a second, 9 min 09 s left",
        "7300/7300 facets, 80.45 a second",
    ]


def test_the_rate_forgets_what_came_before_the_first_answer_and_what_is_long_ago() -> None:
    progress = console.Progress("facets")
    seen = [(0.0, 0), (40.0, 10), (41.0, 20), (60.0, 210), (75.0, 360), (100.0, 1360), (110.0, 1760)]
    rates = []
    for now, done in seen:
        progress._begun_at = 0
        rates.append(progress._rate(now, done))
    assert rates[:2] == [0.0, 0.0]  # compiling, then one answer
    assert rates[2] == 10.0
    assert rates[4] == 10.0
    assert rates[-1] == (1760 - 360) / (110.0 - 75.0)


def test_progress_on_a_terminal_shows_a_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    with console.Console().progress("facets") as progress:
        progress(1, 4)
        progress(4, 4)
    assert "facets" in terminal.text

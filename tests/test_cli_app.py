"""The border of the process: exit codes, streams, signals, help, completion."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest
from scenario_samples import write_minimal

from landing_cli import __version__
from landing_cli.cli import guard
from landing_cli.cli.app import main
from landing_cli.cli.carry_out import carry_out
from landing_cli.cli.console import Console
from landing_cli.errors import (
    ExitCode,
    InputRefused,
    LandingError,
    NothingFeasible,
    OutputRefused,
    PartialResult,
    UsageError,
    VerificationFailed,
)

# pydantic is no part of it: the command-line library brings it in by itself
HEAVY = ("numpy", "scipy", "numba", "yaml", "h5py", "matplotlib", "rich", "trimesh", "joblib")


def script(program: str) -> list[str]:
    """A console script, as its installed wrapper starts it."""
    return [sys.executable, "-c", f"from landing_cli.cli.app import {program}; {program}()"]


def shell(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a shell line in which LANDING stands for the console script."""
    command = f'{sys.executable} -c "from landing_cli.cli.app import landing; landing()"'
    return subprocess.run(
        ["bash", "-c", line.replace("LANDING", command)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (InputRefused, 3),
        (OutputRefused, 3),
        (NothingFeasible, 4),
        (VerificationFailed, 5),
        (PartialResult, 6),
        (UsageError, 2),
    ],
)
def test_each_error_has_its_code_and_one_message(
    error: type[LandingError], code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    def command(_: object) -> int:
        raise error("is wrong", where="here", fix="do this")

    assert guard.told(command, []) == code
    assert capsys.readouterr() == ("", "error: here: is wrong; do this\n")


def test_a_bug_is_one_line_and_its_traceback_is_shown_on_demand(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def command(_: object) -> int:
        return 1 // 0

    assert guard.told(command, []) == ExitCode.BUG
    err = capsys.readouterr().err
    assert "unexpected ZeroDivisionError" in err
    assert "--traceback" in err
    assert len(err.splitlines()) == 1
    assert guard.told(command, ["--traceback"]) == ExitCode.BUG
    assert "Traceback (most recent call last)" in capsys.readouterr().err
    monkeypatch.setenv("LANDING_TRACEBACK", "1")
    guard.told(command, [])
    assert "Traceback" in capsys.readouterr().err


def test_a_full_disk_is_a_refusal_and_not_a_bug(capsys: pytest.CaptureFixture[str]) -> None:
    def command(_: object) -> int:
        raise OSError(28, "No space left on device", "runs/x.h5")

    assert guard.told(command, []) == ExitCode.REFUSED
    assert capsys.readouterr().err == "error: runs/x.h5: No space left on device\n"


def test_a_full_disk_without_a_name_says_where_compiled_kernels_go(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/full/kernels")

    def command(_: object) -> int:
        raise OSError(28, "No space left on device")

    assert guard.told(command, []) == ExitCode.REFUSED
    err = capsys.readouterr().err
    assert err.startswith("error: No space left on device; ")
    assert "/full/kernels" in err


def test_control_characters_of_a_file_name_do_not_reach_the_terminal(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main("reach", ["run", "\x1b[31mred.yaml"]) == ExitCode.REFUSED
    err = capsys.readouterr().err
    assert "\x1b" not in err
    assert "\\x1b[31mred.yaml" in err


@pytest.mark.parametrize(
    ("program", "arguments", "message"),
    [
        ("reach", ["rnu"], "No such command 'rnu'"),
        ("reach", ["run"], "Missing argument 'SCENARIO'"),
        ("reach", ["run", "bennu", "--job", "2"], "No such option: --job"),
        ("reach", ["run", "bennu", "--jobs", "x"], "Invalid value for '--jobs'"),
        ("reach", ["run", "bennu", "--backend", "gpu"], "gpu"),
        ("reach", ["run", "bennu", "--jobs", "0"], "0 jobs"),
        ("reach", ["run", "bennu", "--backend", "dask"], "--scheduler tcp://HOST:8786"),
        ("landing", ["scenario", "init", "x"], "--shape"),
    ],
)
def test_wrong_usage_exits_2_with_one_message(
    program: str, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(program, arguments) == ExitCode.USAGE
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert len(err.splitlines()) <= 2


@pytest.mark.parametrize("program", ["reach", "landing"])
def test_version_and_help_work(program: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(program, ["--version"]) == 0
    assert capsys.readouterr().out == f"landing {__version__}\n"
    assert main(program, ["--help"]) == 0
    assert capsys.readouterr().out.startswith(f"Usage: {program} ")


def test_the_umbrella_runs_the_same_mission(capsys: pytest.CaptureFixture[str]) -> None:
    assert main("reach", ["run", "--help"]) == 0
    alone = capsys.readouterr().out
    assert main("landing", ["reach", "run", "--help"]) == 0
    assert capsys.readouterr().out.replace("landing reach", "reach") == alone


def test_help_imports_nothing_heavy(tmp_path: Path) -> None:
    code = (
        "import sys\nfrom landing_cli.cli.app import main\n"
        "assert main('landing', ['--help']) == 0\nassert main('reach', ['run', '--help']) == 0\n"
        "assert main('plan', ['bezier', '--help']) == 0\n"
        "assert main('tour', ['search', '--help']) == 0\n"
        f"print([name for name in {HEAVY} if name in sys.modules], file=sys.stderr)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert done.stderr.strip() == "[]"


def test_completion_scripts_and_scenario_names_are_offered(tmp_path: Path) -> None:
    environment = {
        **os.environ,
        "_REACH_COMPLETE": "complete_bash",
        "COMP_WORDS": "reach run ben",
        "COMP_CWORD": "2",
    }
    done = subprocess.run(
        script("reach"), capture_output=True, text=True, env=environment, check=False, cwd=tmp_path
    )
    assert "bennu.yaml" in done.stdout
    environment = {**os.environ, "_LANDING_COMPLETE": "source_bash"}
    done = subprocess.run(
        script("landing"), capture_output=True, text=True, env=environment, check=False, cwd=tmp_path
    )
    assert "complete" in done.stdout


def test_a_reader_that_leaves_ends_the_command_quietly(tmp_path: Path) -> None:
    write_minimal(tmp_path)
    done = shell("LANDING scenario schema | head -1; echo ${PIPESTATUS[0]}", tmp_path)
    assert (done.stdout, done.stderr) == ("{\n0\n", "")
    for command in ("scenario schema", "--help", "scenario show probe -q"):
        done = shell(f"LANDING {command} | (exec <&-); echo ${{PIPESTATUS[0]}}", tmp_path)
        assert (done.stdout, done.stderr) == ("0\n", ""), command
    for line in (
        "LANDING scenario show probe -q >&-",
        "LANDING --help >&-",
        "LANDING scenario show probe 2>&-",
    ):
        done = shell(line, tmp_path)
        assert done.returncode == 0, line
        assert "Traceback" not in done.stderr


def test_a_full_stdout_is_refused_with_a_message(tmp_path: Path) -> None:
    write_minimal(tmp_path)
    for line in ("LANDING scenario show probe -q >/dev/full", "LANDING --help >/dev/full"):
        done = shell(line, tmp_path)
        assert done.returncode == ExitCode.REFUSED, line
        assert done.stderr == "error: standard output: cannot be written: No space left on device\n"
    assert shell("LANDING scenario show probe >/dev/null 2>/dev/full", tmp_path).returncode == 0


def test_closed_descriptors_are_not_taken_by_files(tmp_path: Path) -> None:
    write_minimal(tmp_path)
    assert shell("LANDING scenario check probe -q <&- >&- 2>&-", tmp_path).returncode == 0
    done = shell("LANDING scenario check - <&-", tmp_path)
    assert done.returncode == ExitCode.REFUSED
    assert "standard input" in done.stderr


@pytest.mark.parametrize("closed", ["2>&-", "<&- >&- 2>&-", "2>/dev/full"])
def test_progress_goes_nowhere_where_stderr_cannot_be_written(closed: str) -> None:
    code = (
        "from landing_cli.cli import guard\n"
        "def command(arguments):\n"
        "    from landing_cli.cli.console import Console\n"
        "    with Console().progress('facets') as progress:\n"
        "        for done in range(3):\n"
        "            progress(done, 2)\n"
        "    return 0\n"
        "guard.run_process(command)\n"
    )
    line = f'"$0" -c "$1" {closed}'
    done = subprocess.run(["bash", "-c", line, sys.executable, code], check=False)
    assert done.returncode == 0


WAITING = "time.sleep(30)"
DEAF = """
    while True:
        try:
            time.sleep(5)
        except BaseException:
            pass
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("work", [WAITING, DEAF], ids=["waiting", "deaf"])
def test_a_signal_ends_the_process_within_two_seconds(number: signal.Signals, work: str) -> None:
    code = (
        "import sys, time\nfrom landing_cli.cli import guard\n"
        "def command(arguments):\n"
        "    guard.hint_on_interrupt('continue with --resume')\n"
        "    print('ready', file=sys.stderr, flush=True)\n"
        f"    {work}\n"
        "guard.run_process(command)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    assert process.stderr.readline() == "ready\n"
    process.send_signal(number)
    began = time.monotonic()
    assert process.wait(timeout=10) == 128 + number
    assert time.monotonic() - began < 2.0
    assert process.stderr.read() == f"interrupted by {number.name}; continue with --resume\n"
    process.stderr.close()


@pytest.mark.parametrize(("done", "kept"), [(0, False), (3, True)])
def test_an_interrupted_command_speaks_of_what_is_kept_only_where_something_is(
    done: int, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    hints = [""]
    monkeypatch.setattr(guard, "hint_on_interrupt", hints.append)

    def interrupted(progress: Callable[[int, int], None]) -> NoReturn:
        progress(done, 10)
        raise guard.Interrupted(signal.SIGINT)

    with pytest.raises(guard.Interrupted):
        carry_out(interrupted, Path("run.h5"), Console(quiet=True), "facets")
    assert ("--resume" in hints[-1]) == kept

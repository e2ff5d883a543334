"""Tasks shared out among forked copies: each runs once, and nothing is left behind.

Each test runs in a fresh interpreter: other tests leave threads, beside which nothing is forked.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from landing_cli.parallel.forks import share_out


def in_fresh_interpreter(name, *arguments):
    """Run one of the functions below; what it asserts is told by its traceback."""
    call = f"import test_forks; test_forks.{name}(*{arguments!r})"
    done = subprocess.run(
        [sys.executable, "-c", call],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parent)},
        cwd=Path(__file__).parent.parent,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr


def leaving(folder, number):
    """A task that leaves a file with the process it ran in."""

    def task():
        with open(f"{folder}/{number}-{os.getpid()}", "x"):
            time.sleep(0.1)

    return task


def left(folder):
    """Tasks, in order, and the processes that ran them."""
    names = sorted(os.listdir(folder))
    return [name.split("-")[0] for name in names], {name.split("-")[1] for name in names}


def runs_once(folder, processes):
    share_out([leaving(folder, number) for number in range(6)], processes)
    tasks, workers = left(folder)
    assert tasks == list("012345")
    assert len(workers) <= processes
    assert (len(workers) > 1) == (processes > 1)


@pytest.mark.parametrize("processes", [1, 2, 5])
def test_every_task_runs_once(tmp_path, processes):
    in_fresh_interpreter("runs_once", str(tmp_path), processes)


def leaves_no_copy(folder):
    share_out([leaving(folder, number) for number in range(4)], 3)
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)


def test_no_copy_is_left(tmp_path):
    in_fresh_interpreter("leaves_no_copy", str(tmp_path))


def loses_one(folder):
    parent = os.getpid()

    def die():
        if os.getpid() != parent:
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(0.5)

    share_out([die, die, leaving(folder, 2)], 2)
    assert left(folder)[0] == ["2"]


def test_a_copy_that_dies_loses_its_own_task_alone(tmp_path):
    in_fresh_interpreter("loses_one", str(tmp_path))


def raises():
    def wrong():
        raise ValueError("told")

    with pytest.raises(ValueError, match="told"):
        share_out([wrong], 2)


def test_what_this_process_raises_is_raised():
    in_fresh_interpreter("raises")


def stays_alone(folder, daemon):
    stop = threading.Event()
    other = threading.Thread(target=stop.wait, daemon=daemon)
    other.start()
    try:
        share_out([leaving(folder, number) for number in range(3)], 3)
    finally:
        stop.set()
        other.join()
    tasks, workers = left(folder)
    assert tasks == list("012")
    assert (workers == {str(os.getpid())}) == (not daemon)


@pytest.mark.parametrize("daemon", [False, True])
def test_beside_threads_at_work_nothing_is_forked(tmp_path, daemon):
    in_fresh_interpreter("stays_alone", str(tmp_path), daemon)


def sleeps(folder):
    def task():
        Path(folder, str(os.getpid())).touch()
        time.sleep(60)

    share_out([task, task], 2)


def test_an_interruption_takes_the_copies_along(tmp_path):
    program = subprocess.Popen(
        [sys.executable, "-c", f"import test_forks; test_forks.sleeps({str(tmp_path)!r})"],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parent)},
        cwd=Path(__file__).parent.parent,
        stderr=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + 60
    while len(os.listdir(tmp_path)) < 2 and time.monotonic() < deadline:
        time.sleep(0.02)
    program.send_signal(signal.SIGINT)
    program.wait(timeout=20)
    assert len(os.listdir(tmp_path)) == 2
    for name in os.listdir(tmp_path):
        with pytest.raises(ProcessLookupError):
            os.kill(int(name), 0)

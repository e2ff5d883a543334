"""Tasks shared out among forked copies: each runs once, and nothing is left behind."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import pytest

from landing_cli.parallel.forks import share_out


def leaving(folder, number):
    """A task that leaves a file with the process it ran in."""

    def task():
        with open(folder / f"{number}-{os.getpid()}", "x"):
            time.sleep(0.05)

    return task


@pytest.mark.parametrize("processes", [1, 2, 5])
def test_every_task_runs_once(tmp_path, processes):
    share_out([leaving(tmp_path, number) for number in range(6)], processes)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert [name.split("-")[0] for name in names] == list("012345")
    workers = {name.split("-")[1] for name in names}
    assert len(workers) <= processes
    assert (len(workers) > 1) == (processes > 1)


def test_no_copy_is_left(tmp_path):
    share_out([leaving(tmp_path, number) for number in range(4)], 3)
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)


def test_a_copy_that_fails_or_dies_loses_its_own_task_alone(tmp_path):
    parent = os.getpid()

    def fail():
        if os.getpid() != parent:
            time.sleep(0.2)
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(0.5)

    share_out([fail, fail, leaving(tmp_path, 2)], 2)
    assert len(list(tmp_path.iterdir())) == 1


def test_what_this_process_raises_is_raised(tmp_path):
    def wrong():
        raise ValueError("told")

    with pytest.raises(ValueError, match="told"):
        share_out([wrong], 2)


def test_beside_other_threads_nothing_is_forked(tmp_path):
    stop = threading.Event()
    other = threading.Thread(target=stop.wait)
    other.start()
    try:
        share_out([leaving(tmp_path, number) for number in range(3)], 3)
    finally:
        stop.set()
        other.join()
    assert {path.name.split("-")[1] for path in tmp_path.iterdir()} == {str(os.getpid())}


def test_an_interruption_takes_the_copies_along(tmp_path):
    script = textwrap.dedent(f"""
        import os, pathlib, time
        from landing_cli.parallel.forks import share_out
        def task():
            pathlib.Path({str(tmp_path)!r}, str(os.getpid())).touch()
            time.sleep(60)
        share_out([task, task], 2)
    """)
    program = subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while len(list(tmp_path.iterdir())) < 2 and time.monotonic() < deadline:
        time.sleep(0.02)
    program.send_signal(signal.SIGINT)
    program.wait(timeout=20)
    for path in tmp_path.iterdir():
        with pytest.raises(ProcessLookupError):
            os.kill(int(path.name), 0)

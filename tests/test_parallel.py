"""Chunks come back, whatever happens to the workers."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import toy_work

from landing_cli.errors import InputRefused, UsageError
from landing_cli.parallel import LostChunk, WorkPlan, run_chunks

CHUNKS = [range(i, i + 4) for i in range(0, 40, 4)]
LOCAL = [WorkPlan(1), WorkPlan(2), WorkPlan(2, "loky")]


def collect(function, chunks, plan):
    done, lost = {}, []
    for _, answer in run_chunks(function, chunks, plan):
        if isinstance(answer, LostChunk):
            lost.append(answer)
        else:
            done.update({round(square**0.5): int(square) for square in answer})
    return done, lost


@pytest.mark.parametrize("plan", LOCAL, ids=str)
def test_every_chunk_comes_back_once_under_its_index(plan):
    answers = list(run_chunks(toy_work.squares, CHUNKS, plan))
    assert sorted(index for index, _ in answers) == list(range(len(CHUNKS)))
    for index, answer in answers:
        np.testing.assert_array_equal(answer, np.array(CHUNKS[index]) ** 2)


@pytest.mark.parametrize("plan", LOCAL, ids=str)
def test_an_error_in_the_function_reaches_the_caller_as_it_was(plan):
    with pytest.raises(InputRefused) as caught:
        list(run_chunks(toy_work.refuses, CHUNKS, plan))
    assert caught.value.fix == "none"


@pytest.mark.parametrize("plan", LOCAL, ids=str)
def test_leaving_early_takes_less_than_two_seconds_and_leaves_no_thread_or_process(plan):
    threads = threading.active_count()
    with closing(run_chunks(partial(toy_work.squares, pause_s=0.3), CHUNKS, plan)) as answers:
        next(answers)
        start = time.monotonic()
    assert time.monotonic() - start < 1.5
    time.sleep(0.1)
    assert threading.active_count() <= threads
    assert not _children()


@pytest.mark.parametrize("plan", LOCAL, ids=str)
def test_workers_do_not_run_ahead_of_a_slow_disk(plan, tmp_path: Path):
    """What is begun but not recorded is what a kill costs: at most two chunks a job."""
    chunks = [[i] for i in range(40)]
    begun, taken = tmp_path / "begun", 0
    with closing(run_chunks(partial(toy_work.notes, begun), chunks, plan)) as answers:
        for _ in answers:
            time.sleep(0.05 if taken < 6 else 0)
            assert len(begun.read_text()) - taken <= 2 * plan.jobs
            taken += 1
    assert taken == len(chunks)


def test_answers_larger_than_a_pipe_come_through():
    answers = dict(run_chunks(toy_work.big_answer, CHUNKS[:4], WorkPlan(2, "loky")))
    assert {i: a[0, 0] for i, a in answers.items()} == {0: 0, 1: 4, 2: 8, 3: 12}


def test_loky_workers_ignore_ctrl_c_and_run_blas_on_one_thread():
    answers = dict(run_chunks(toy_work.who_am_i, CHUNKS[:2], WorkPlan(2, "loky")))
    for facts in answers.values():
        assert facts["pid"] != os.getpid()
        assert facts["sigint"] is True
        assert facts["masked"] is True  # from the first instruction on
        assert facts["blas"] == "1"


def test_a_worker_that_dies_once_costs_nothing(tmp_path: Path):
    work = partial(toy_work.dies_once, tmp_path / "died", 13)
    done, lost = collect(work, CHUNKS, WorkPlan(2, "loky"))
    assert (tmp_path / "died").exists()
    assert not lost
    assert done == {i: i * i for i in range(40)}


def test_the_item_that_keeps_killing_its_worker_is_found_and_only_it_is_lost():
    done, lost = collect(partial(toy_work.dies_on, 13), CHUNKS, WorkPlan(2, "loky"))
    assert [(list(chunk.items), "SIGKILL" in chunk.reason) for chunk in lost] == [([13], True)]
    assert done == {i: i * i for i in range(40) if i != 13}


PARENT = """
import sys
from functools import partial
import toy_work
from landing_cli.parallel import WorkPlan, run_chunks
work = partial(toy_work.squares, pause_s=0.2)
for index, answer in run_chunks(work, [[i] for i in range(500)], WorkPlan(2, "loky")):
    print(index, flush=True)
"""


def test_workers_die_with_a_parent_that_is_killed_even_in_the_middle_of_a_chunk():
    script = PARENT.replace("partial(toy_work.squares, pause_s=0.2)", "toy_work.gets_stuck")
    parent = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, env=_environment())
    assert parent.stdout is not None
    parent.stdout.readline()
    workers = _children(parent.pid)
    assert len(workers) >= 2
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 4
    while any(_alive(pid) for pid in workers) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not [pid for pid in workers if _alive(pid)]


def test_ctrl_c_in_the_terminal_ends_the_parent_alone_and_silently_in_the_workers():
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=_environment(),
        start_new_session=True,
    )
    assert parent.stdout is not None
    parent.stdout.readline()
    workers = _children(parent.pid)
    start = time.monotonic()
    os.killpg(parent.pid, signal.SIGINT)
    _, told = parent.communicate(timeout=5)
    assert time.monotonic() - start < 2
    assert told.count(b"Traceback") == 1
    assert not [pid for pid in workers if _alive(pid)]


def test_workers_that_never_come_up_are_given_up_with_the_reason():
    done, lost = collect(toy_work.Unloadable(), CHUNKS, WorkPlan(2, "loky"))
    assert not done
    assert sorted(item for chunk in lost for item in chunk.items) == list(range(40))
    assert all("no worker could be started" in chunk.reason and "code 3" in chunk.reason for chunk in lost)


@pytest.mark.parametrize(
    "arguments",
    [
        {"jobs": 0},
        {"backend": "spark"},
        {"backend": "dask"},
        {"backend": "threads", "scheduler": "tcp://127.0.0.1:1"},
    ],
)
def test_a_plan_that_cannot_be_carried_out_is_refused(arguments):
    with pytest.raises(UsageError, match="--"):
        WorkPlan(**arguments)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Start a scheduler and two worker processes on loopback."""
    pytest.importorskip("distributed")
    folder = tmp_path_factory.mktemp("dask")
    port = "38786"
    address = f"tcp://127.0.0.1:{port}"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder, "env": _environment()}
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", port]
    command = [
        sys.executable,
        "-m",
        "distributed.cli.dask_worker",
        address,
        "--nthreads",
        "1",
        "--no-dashboard",
    ]
    started = [subprocess.Popen([*dask, "--no-dashboard"], **quiet)]
    started += [subprocess.Popen(command, **quiet) for _ in range(2)]
    from distributed import Client

    with Client(address, timeout=20, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=30)
    yield address
    for process in reversed(started):
        process.terminate()
        try:
            process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def test_dask_gives_the_same_answers(cluster: str):
    done, lost = collect(toy_work.squares, CHUNKS, WorkPlan(1, "dask", cluster))
    assert not lost
    assert done == {i: i * i for i in range(40)}


def test_dask_survives_the_death_of_a_worker(cluster: str, tmp_path: Path):
    work = partial(toy_work.dies_once, tmp_path / "died", 13)
    done, lost = collect(work, CHUNKS, WorkPlan(1, "dask", cluster))
    assert (tmp_path / "died").exists()
    assert not lost
    assert done == {i: i * i for i in range(40)}


def test_dask_hands_on_the_error_of_the_function(cluster: str):
    with pytest.raises(InputRefused, match="none"):
        list(run_chunks(toy_work.refuses, CHUNKS, WorkPlan(1, "dask", cluster)))


@pytest.mark.slow
def test_dask_reports_the_item_that_keeps_killing_its_worker(cluster: str):
    done, lost = collect(partial(toy_work.dies_on, 5), CHUNKS[:3], WorkPlan(1, "dask", cluster))
    assert [list(chunk.items) for chunk in lost] == [[5]]
    assert done == {i: i * i for i in range(12) if i != 5}


def test_a_cluster_that_does_not_answer_is_refused_with_the_command_that_starts_one(monkeypatch):
    cluster = pytest.importorskip("landing_cli.parallel.cluster")
    monkeypatch.setattr(cluster, "CONNECT_TIMEOUT_S", 0.5)
    with pytest.raises(InputRefused, match="dask scheduler"):
        next(run_chunks(toy_work.squares, CHUNKS, WorkPlan(1, "dask", "tcp://127.0.0.1:9")))


@pytest.fixture
def lone_scheduler(tmp_path: Path) -> Iterator[str]:
    """Start a scheduler without workers on loopback."""
    pytest.importorskip("distributed")
    port, quiet = "38788", {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", port]
    process = subprocess.Popen([*command, "--no-dashboard"], **quiet)
    yield f"tcp://127.0.0.1:{port}"
    process.kill()
    process.wait()


STRANGE_WORKERS = {
    # what runs before anything in the worker's interpreter; the words of the refusal
    "lacks a package": (
        "import sys\n"
        "class Absent:\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name.split('.')[0] == 'landing_cli':\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}')\n"
        "sys.meta_path.insert(0, Absent())\n",
        r"worker tcp://.* lacks a package|worker tcp://.* failed a first task",
    ),
    "has another version": (
        "import landing_cli\nlanding_cli.__version__ = '0.0.9'\n",
        r"worker tcp://.* has landing 0\.0\.9 \(here ",
    ),
}


def test_a_cluster_without_workers_is_refused_with_the_command_that_starts_one(lone_scheduler: str):
    with pytest.raises(InputRefused, match="no worker; start some with `dask worker tcp"):
        list(run_chunks(toy_work.squares, CHUNKS, WorkPlan(1, "dask", lone_scheduler)))


@pytest.mark.parametrize("fault", STRANGE_WORKERS)
def test_a_worker_that_cannot_do_the_work_is_named_with_what_to_install(
    lone_scheduler: str, tmp_path: Path, fault: str, monkeypatch
):
    cluster = pytest.importorskip("landing_cli.parallel.cluster")
    # without our package a worker drops the task, and says nothing
    monkeypatch.setattr(cluster, "PREFLIGHT_TIMEOUT_S", 15.0)
    (tmp_path / "sitecustomize.py").write_text(STRANGE_WORKERS[fault][0])
    with _worker(lone_scheduler, tmp_path):
        with pytest.raises(InputRefused, match=STRANGE_WORKERS[fault][1]) as caught:
            list(run_chunks(toy_work.squares, CHUNKS, WorkPlan(1, "dask", lone_scheduler)))
        assert 'pip install "landing[cluster]==' in caught.value.fix


def test_a_worker_that_does_not_answer_is_named_in_time(lone_scheduler: str, tmp_path: Path, monkeypatch):
    from landing_cli.parallel import cluster

    monkeypatch.setattr(cluster, "PREFLIGHT_TIMEOUT_S", 1.0)
    with _worker(lone_scheduler, tmp_path) as worker:
        worker.send_signal(signal.SIGSTOP)
        began = time.monotonic()
        with pytest.raises(InputRefused, match=r"worker tcp://.* failed a first task: .*(imeout|timed out)"):
            list(run_chunks(toy_work.squares, CHUNKS, WorkPlan(1, "dask", lone_scheduler)))
        assert time.monotonic() - began < 30.0  # of the 60 s that a hung worker gets


@contextmanager
def _worker(scheduler: str, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Start a Dask worker, without a nanny, whose interpreter begins with the folder's sitecustomize."""
    from distributed import Client

    path = os.pathsep.join([str(folder), _environment()["PYTHONPATH"]])
    command = [
        sys.executable,
        "-m",
        "distributed.cli.dask_worker",
        scheduler,
        "--nthreads",
        "1",
        "--no-nanny",
    ]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    process = subprocess.Popen(
        [*command, "--no-dashboard"], env={**_environment(), "PYTHONPATH": path}, **quiet
    )
    try:
        with Client(scheduler, timeout=20, set_as_default=False) as client:
            client.wait_for_workers(1, timeout=30)
        yield process
    finally:
        process.kill()
        process.wait()


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputRefused, match=r'pip install "landing\[cluster\]"'):
        next(run_chunks(toy_work.squares, CHUNKS, WorkPlan(1, "dask", "tcp://127.0.0.1:9")))


def _environment() -> dict[str, str]:
    here = str(Path(__file__).parent)
    return {**os.environ, "PYTHONPATH": os.pathsep.join([here, os.environ.get("PYTHONPATH", "")])}


def _children(parent: int | None = None) -> list[int]:
    """Pids of the Python workers that a process has started (not loky's resource trackers)."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                status = (entry / "stat").read_text().rsplit(")", 1)[1].split()
                command = (entry / "cmdline").read_bytes()
            except OSError:
                continue
            if int(status[1]) == (parent or os.getpid()) and status[0] != "Z" and b"popen_loky" in command:
                found.append(int(entry.name))
    return found


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False

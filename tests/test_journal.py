"""What a journal has recorded stays, whatever happens to the file's end or middle."""

from __future__ import annotations

import os
import resource
import signal
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from landing_cli.errors import InputRefused, OutputRefused
from landing_cli.reach.records import FACET_DTYPE, FacetSolutions, blank_rows
from landing_cli.reach.stored import solutions_from_arrays, solutions_to_arrays
from landing_cli.results.disk import lock_file
from landing_cli.results.identity import RunIdentity
from landing_cli.results.journal import Journal, read_journal
from landing_cli.results.output import OutputState, inspect_output, journal_path, open_output

IDENTITY = RunIdentity("reach run", "name: bennu\nreach:\n  tof_s: 700\n", "a" * 64, "0.1.0", 1, 64)
CHUNKS = 6


def chunk(index: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(index)
    rows = blank_rows(np.arange(8) + 8 * index)
    rows["performance_index_m2_s3"] = rng.normal(size=8)
    rows["thrust_nodes"] = 3
    return solutions_to_arrays(FacetSolutions(rows, rng.normal(size=(24, 3))))


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """Leave an unfinished run of CHUNKS chunks behind and return the result's path."""
    path = tmp_path / "run.h5"
    with opened(path) as journal:
        for index in range(CHUNKS):
            journal.append(f"case/{index}", chunk(index))
    return path


def opened(path: Path, identity: RunIdentity = IDENTITY, **choices: bool) -> Journal:
    journal = open_output(path, identity, **choices)
    assert journal is not None
    return journal


def same(arrays: dict[str, np.ndarray], index: int) -> bool:
    expected = chunk(index)
    return all(arrays[k].tobytes() == expected[k].tobytes() for k in expected) and set(arrays) == set(
        expected
    )


def test_a_journal_gives_back_every_record_bit_for_bit(recorded: Path) -> None:
    with opened(recorded, resume=True) as journal:
        assert list(journal.records) == [f"case/{i}" for i in range(CHUNKS)]
        for index in range(CHUNKS):
            arrays = journal.records[f"case/{index}"]
            assert arrays["rows"].dtype == FACET_DTYPE
            assert same(arrays, index)
            assert len(solutions_from_arrays(arrays).nodes_of(7)) == 3


def test_a_resumed_journal_goes_on_where_it_ended(recorded: Path) -> None:
    with opened(recorded, resume=True) as journal:
        journal.append("case/more", chunk(99))
    with opened(recorded, resume=True) as journal:
        assert len(journal.records) == CHUNKS + 1
        assert same(journal.records["case/more"], 99)


def test_a_journal_cut_anywhere_keeps_every_whole_record_before_the_cut(recorded: Path) -> None:
    path = journal_path(recorded)
    whole = path.read_bytes()
    kept = []
    for cut in range(0, len(whole), 97):
        path.write_bytes(whole[:cut])
        content = read_journal(path)
        records = content.records if content else {}
        assert all(same(arrays, int(key.split("/")[1])) for key, arrays in records.items())
        kept.append(len(records))
    assert kept == sorted(kept)
    assert kept[-1] == CHUNKS - 1


def test_a_cut_journal_is_mended_by_the_next_run(recorded: Path) -> None:
    path = journal_path(recorded)
    path.write_bytes(path.read_bytes()[:-100])
    with opened(recorded, resume=True) as journal:
        assert len(journal.records) == CHUNKS - 1
        journal.append(f"case/{CHUNKS - 1}", chunk(CHUNKS - 1))
    with opened(recorded, resume=True) as journal:
        assert all(same(journal.records[f"case/{i}"], i) for i in range(CHUNKS))


def test_a_flipped_bit_gives_right_records_or_a_refusal(recorded: Path) -> None:
    path = journal_path(recorded)
    whole = bytearray(path.read_bytes())
    rng = np.random.default_rng(1)
    refused = 0
    for _ in range(500):
        place = int(rng.integers(len(whole) * 8))
        whole[place // 8] ^= 1 << place % 8
        path.write_bytes(whole)
        whole[place // 8] ^= 1 << place % 8
        try:
            content = read_journal(path)
        except InputRefused:
            refused += 1
            continue
        assert content is not None
        assert content.identity in (IDENTITY, None)
        assert all(same(arrays, int(key.split("/")[1])) for key, arrays in content.records.items())
    assert 0 < refused < 250


def test_doubled_records_count_once_and_a_doubled_file_is_read_to_its_first_end(recorded: Path) -> None:
    path = journal_path(recorded)
    whole = path.read_bytes()
    with opened(recorded, resume=True) as journal:
        journal.append("case/0", chunk(50))
    content = read_journal(path)
    assert content is not None
    assert same(content.records["case/0"], 0)
    path.write_bytes(whole + whole)
    content = read_journal(path)
    assert content is not None
    assert len(content.records) == CHUNKS
    assert content.sound_bytes == len(whole)


@pytest.mark.parametrize(
    "hostile",
    [
        b'{"key": "x", "arrays": [["a", "|O", [1]]]}',
        b'{"key": "x", "arrays": [["a", "<f8", [1000000000000]]]}',
        b'{"key": "x", "arrays": [["a", "<f8", [-1]]]}',
        b'{"key": "x", "arrays": [["a", "<f8", [0, 1000000000000000000000000]]]}',
        b'{"key": "x", "arrays": [["a", [["b", "<f8", [1000000000, 1000000000]]], [1]]]}',
        b'{"key": "x", "arrays": [["a", "<f8", [1.5]]]}',
        b'{"key": ["x"], "arrays": []}',
        b"[" * 100_000,
        b"[]",
        b"\xff",
    ],
)
def test_a_record_of_nonsense_under_a_sound_checksum_ends_the_reading(recorded: Path, hostile: bytes) -> None:
    from landing_cli.results import journal as module

    body = struct.pack("<I", len(hostile)) + hostile
    record = module._PREFIX.pack(b"RCRD", module._checksum(body), len(body)) + body
    path = journal_path(recorded)
    path.write_bytes(path.read_bytes() + record)
    content = read_journal(path)
    assert content is not None
    assert len(content.records) == CHUNKS


def test_a_run_that_recorded_nothing_leaves_nothing(tmp_path: Path) -> None:
    opened(tmp_path / "run.h5").close()
    assert list(tmp_path.iterdir()) == []


def test_every_record_is_on_the_disk_before_the_next_is_awaited(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[int] = []
    real = os.fdatasync
    monkeypatch.setattr(os, "fdatasync", lambda fd: (synced.append(os.fstat(fd).st_size), real(fd))[1])
    with opened(tmp_path / "run.h5") as journal:
        for index in range(3):
            journal.append(f"case/{index}", chunk(index))
            assert synced[-1] == journal_path(tmp_path / "run.h5").stat().st_size
    assert len(synced) == 4


def test_a_lock_on_a_file_that_its_owner_just_deleted_is_no_lock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import fcntl

    path, real, calls = tmp_path / "x", fcntl.flock, []

    def flock(descriptor: int, how: int) -> None:
        if not calls:
            path.unlink()  # the first owner finishes between our open and our lock
        calls.append(descriptor)
        real(descriptor, how)

    monkeypatch.setattr(fcntl, "flock", flock)
    descriptor = lock_file(path)
    assert len(calls) == 2
    assert os.fstat(descriptor).st_ino == path.stat().st_ino
    os.close(descriptor)


def test_arrays_of_objects_are_not_recorded(tmp_path: Path) -> None:
    with opened(tmp_path / "run.h5") as journal, pytest.raises(TypeError, match="numbers"):
        journal.append("x", {"a": np.array([{}])})


def test_an_unfinished_run_is_refused_with_the_choices(recorded: Path) -> None:
    with pytest.raises(OutputRefused) as caught:
        open_output(recorded, IDENTITY)
    assert "6 chunks are safe" in caught.value.what
    assert "--resume" in caught.value.fix
    assert "--force" in caught.value.fix


def test_a_different_unfinished_run_is_refused_with_what_changed(recorded: Path) -> None:
    other = RunIdentity("reach run", IDENTITY.scenario.replace("700", "900"), "b" * 64, "0.1.0", 1, 64)
    for choices in ({}, {"resume": True}):
        with pytest.raises(OutputRefused, match="tof_s: 700 -> tof_s: 900") as caught:
            open_output(recorded, other, **choices)
        assert "shape: sha256 aaaaaaaaaaaa... -> bbbbbbbbbbbb..." in caught.value.what
    with opened(recorded, other, force=True) as journal:
        assert journal.records == {}


@pytest.mark.parametrize(
    ("stored", "now", "same"),
    [
        ("a: 1", "a: 1  # why", True),
        ("# top\na: 1", "a: 1", True),
        ("a: 1", "a: 2", False),
        ('a: "x #1"', 'a: "x #2"', False),
        ("a: x#1", "a: x#2", False),
        ("a:\n  b:\n    c: 1", "a:\n  b:\n  c: 1", False),
        ("a: 1\nb: 2", "a: 1", False),
    ],
)
def test_comments_alone_make_no_other_run(stored: str, now: str, same: bool) -> None:
    one, two = (RunIdentity("reach run", text, "a", "1") for text in (stored, now))
    assert (two.differences(one) == []) is same


def test_a_second_run_on_one_output_is_refused_at_once_whatever_it_asks(recorded: Path) -> None:
    with opened(recorded, resume=True):
        for choices in ({}, {"resume": True}, {"force": True}):
            with pytest.raises(OutputRefused, match="another run is writing"):
                open_output(recorded, IDENTITY, **choices)
    opened(recorded, resume=True).close()


def test_the_lock_goes_with_the_process_however_it_ends(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    script = (
        "import sys, time; from pathlib import Path; import test_journal as t;"
        "j = t.opened(Path(sys.argv[1])); j.append('case/0', t.chunk(0)); print(flush=True); time.sleep(60)"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent)}
    holder = subprocess.Popen([sys.executable, "-c", script, path], stdout=subprocess.PIPE, env=environment)
    assert holder.stdout is not None
    holder.stdout.readline()
    with pytest.raises(OutputRefused, match="another run"):
        open_output(path, IDENTITY, resume=True)
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    with opened(path, resume=True) as journal:
        assert same(journal.records["case/0"], 0)


def test_a_journal_on_a_full_disk_keeps_what_it_had(recorded: Path) -> None:
    """The limit on file sizes stands for the full disk: the kernel takes a part, then refuses."""
    size = journal_path(recorded).stat().st_size
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with opened(recorded, resume=True) as journal:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size + 1000, hard))
        try:
            with pytest.raises(OutputRefused, match=r"6 chunks are safe") as caught:
                journal.append("case/more", chunk(99))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        assert "limit on file sizes" in str(caught.value)
    assert journal_path(recorded).stat().st_size == size
    with opened(recorded, resume=True) as journal:
        assert len(journal.records) == CHUNKS


def test_a_file_that_is_no_journal_is_never_touched(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    journal_path(path).write_text("my diary")
    for choices in ({}, {"resume": True}, {"force": True}):
        with pytest.raises(OutputRefused, match="did not write"):
            open_output(path, IDENTITY, **choices)
    assert journal_path(path).read_text() == "my diary"


def test_a_damaged_header_is_refused_until_forced(recorded: Path) -> None:
    path = journal_path(recorded)
    damaged = bytearray(path.read_bytes())
    damaged[60] ^= 1
    path.write_bytes(damaged)
    assert inspect_output(recorded, IDENTITY).state is OutputState.DAMAGED
    with pytest.raises(OutputRefused, match="--force"):
        open_output(recorded, IDENTITY, resume=True)
    opened(recorded, force=True).close()


@pytest.mark.parametrize("kind", ["folder", "fifo", "journal_fifo", "device", "below_a_file"])
def test_odd_output_paths_are_refused_at_once(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "run.h5"
    if kind == "folder":
        path.mkdir()
    elif kind == "fifo":
        os.mkfifo(path)
    elif kind == "journal_fifo":
        os.mkfifo(journal_path(path))
    elif kind == "device":
        path = Path("/dev/full")
    else:
        path.touch()
        path = path / "run.h5"
    with pytest.raises(OutputRefused):
        open_output(path, IDENTITY, force=True)


def test_a_record_of_another_version_is_refused() -> None:
    with pytest.raises(InputRefused, match="other columns"):
        solutions_from_arrays({"rows": np.zeros(3), "thrust_nodes_n": np.zeros((0, 3))})
    rows = blank_rows(np.arange(3))
    rows["thrust_nodes"] = 2
    with pytest.raises(InputRefused, match="do not fit"):
        solutions_from_arrays({"rows": rows, "thrust_nodes_n": np.zeros((5, 3))})

"""The journal of a run in progress: what is recorded survives a kill at any instant.

Layout: a magic line, then records. A record is a marker, the CRC-32 of the rest, the length of its
body and the body: a JSON head (key, arrays by name, dtype, shape) and the arrays' bytes. The first
record is the header: the identity of the run. Reading stops at the first damaged record; what
follows cannot be trusted and is solved again.
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import prod
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.results.disk import read_whole, refusal, sync_folder, write_all
from landing_cli.results.identity import RunIdentity

Arrays = dict[str, NDArray[Any]]

MAGIC = b"landing journal 1\r\n\x1a\n"
HEADER_KEY = "header"
_PREFIX = struct.Struct("<4sIQ")
_MARKER = b"RCRD"
_HEAD_LENGTH = struct.Struct("<I")
_NONSENSE = (ValueError, KeyError, TypeError, AttributeError, ArithmeticError, RecursionError, struct.error)


class NotAJournal(InputRefused):
    """A file of that name which this program did not write."""


@dataclass(frozen=True)
class JournalContent:
    """What a journal on disk holds.

    Attributes
    ----------
    identity : RunIdentity or None
        Of the run; None where the file ends before it (nothing is lost then).
    records : dict
        Arrays by name, by key; of records written twice the first.
    sound_bytes : int
        How far the file can be trusted.
    """

    identity: RunIdentity | None
    records: dict[str, Arrays]
    sound_bytes: int


class Journal:
    """An open journal. Its descriptor holds the lock on the output (``output.open_output``).

    Parameters
    ----------
    path : Path
        Where it lies.
    descriptor : int
        Locked, open for writing; closed with the journal.
    identity : RunIdentity
        Of this run.
    content : JournalContent or None
        What to continue; None starts over.
    """

    def __init__(
        self, path: Path, descriptor: int, identity: RunIdentity, content: JournalContent | None = None
    ) -> None:
        self.path = path
        self.identity = identity
        self.records: dict[str, Arrays] = dict(content.records) if content else {}
        self._descriptor = descriptor
        self._count = len(self.records)
        fresh = content is None or content.identity is None
        self._end = 0 if fresh or content is None else content.sound_bytes
        try:
            os.ftruncate(descriptor, self._end)
            os.lseek(descriptor, self._end, os.SEEK_SET)
        except OSError as error:
            raise refusal(error, path) from error
        if fresh:
            self._write(MAGIC + _pack(HEADER_KEY, {}, identity.as_dict()))
            sync_folder(path.parent)

    def append(self, key: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Record arrays durably under a key.

        Parameters
        ----------
        key : str
            Names the chunk; recording a key again changes nothing that is read back.
        arrays : mapping of arrays
            By name; numbers, booleans and structured rows of them.

        Raises
        ------
        OutputRefused
            If the disk does not take it; what was recorded before stays.
        """
        self._write(_pack(key, arrays))
        self._count += 1

    def _write(self, data: bytes) -> None:
        try:
            write_all(self._descriptor, data)
            os.fdatasync(self._descriptor)
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._descriptor, self._end)
            told = f"and run again with --resume ({self._count} chunks are safe)" if self._count else ""
            raise refusal(error, self.path, told) from error
        self._end += len(data)

    def discard(self) -> None:
        """Delete the journal: its run is stored elsewhere."""
        with suppress(OSError):
            self.path.unlink()
        self.close()

    def close(self) -> None:
        """Release the lock; a journal without any record is deleted."""
        descriptor, self._descriptor = self._descriptor, -1  # an interrupt must not let it be closed twice
        if descriptor < 0:
            return
        if not self._count:
            with suppress(OSError):
                self.path.unlink()
        os.close(descriptor)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def read_journal(path: Path) -> JournalContent | None:
    """Read what can be trusted of a journal.

    Parameters
    ----------
    path : Path
        The journal; it is not changed.

    Returns
    -------
    JournalContent or None
        None where there is no journal, or an empty file.

    Raises
    ------
    InputRefused
        If its header is damaged; ``NotAJournal`` if it is none.
    """
    if not path.exists():
        return None
    data = memoryview(read_whole(path))
    if len(data) < len(MAGIC) and MAGIC.startswith(data.tobytes()):
        return JournalContent(None, {}, 0) if data else None
    if data[: len(MAGIC)] != MAGIC:
        raise NotAJournal("is no journal of this program", where=str(path), fix="move it away")
    records = _records(data)
    first = next(records, None)
    if first is None:
        return _without_header(data, path)
    key, head, _, end = first
    try:
        if key != HEADER_KEY:
            raise ValueError("no header")
        identity = RunIdentity.from_dict(head)
    except ValueError as error:
        raise _damaged(path) from error
    kept: dict[str, Arrays] = {}
    for key, _, arrays, sound in records:
        end = sound
        if key != HEADER_KEY:
            kept.setdefault(key, arrays)
    return JournalContent(identity, kept, end)


def _without_header(data: memoryview, path: Path) -> JournalContent:
    """A header that the end of the file cuts off was being written at the kill: nothing is lost."""
    rest = data[len(MAGIC) :]
    cut = len(rest) < _PREFIX.size
    if not cut:
        marker, _, length = _PREFIX.unpack(rest[: _PREFIX.size])
        cut = marker == _MARKER and length > len(rest) - _PREFIX.size
    if not cut:
        raise _damaged(path)
    return JournalContent(None, {}, 0)


def _damaged(path: Path) -> InputRefused:
    return InputRefused("the journal's header is damaged", where=str(path), fix="start over with --force")


def _records(data: memoryview) -> Iterator[tuple[str, dict[str, Any], Arrays, int]]:
    """Yield (key, head, arrays, end) of every record up to the first damaged one."""
    at = len(MAGIC)
    while at + _PREFIX.size <= len(data):
        marker, crc, length = _PREFIX.unpack(data[at : at + _PREFIX.size])
        body = data[at + _PREFIX.size :][:length]
        if marker != _MARKER or len(body) < length or _checksum(body) != crc:
            return
        at += _PREFIX.size + length
        try:
            yield *_unpack(body), at
        except _NONSENSE:  # under a sound checksum
            return


def _checksum(body: bytes | memoryview) -> int:
    return zlib.crc32(body, zlib.crc32(struct.pack("<Q", len(body))))


def _pack(key: str, arrays: Mapping[str, NDArray[Any]], more: Mapping[str, Any] | None = None) -> bytes:
    tight = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    described = [[name, _dtype_to_json(a.dtype), list(a.shape)] for name, a in tight.items()]
    head = json.dumps({**(more or {}), "key": key, "arrays": described}).encode()
    body = b"".join([_HEAD_LENGTH.pack(len(head)), head, *(a.tobytes() for a in tight.values())])
    return _PREFIX.pack(_MARKER, _checksum(body), len(body)) + body


def _unpack(body: memoryview) -> tuple[str, dict[str, Any], Arrays]:
    (length,) = _HEAD_LENGTH.unpack(body[: _HEAD_LENGTH.size])
    at = _HEAD_LENGTH.size + length
    head = json.loads(body[_HEAD_LENGTH.size : at].tobytes())
    arrays = {}
    for name, described, shape in head["arrays"]:
        dtype = _dtype_from_json(described)
        size = dtype.itemsize * prod(shape)
        if any(n < 0 for n in shape) or at + size > len(body):
            raise ValueError("an array exceeds its record")
        arrays[name] = np.frombuffer(body[at : at + size], dtype=dtype).reshape(shape).copy()
        at += size
    if not isinstance(head["key"], str):
        raise ValueError("a record without a name")
    return head["key"], head, arrays


def _dtype_to_json(dtype: np.dtype[Any]) -> Any:
    if dtype.names is None:
        if dtype.kind not in "biuf":
            raise TypeError(f"a journal holds numbers and rows of numbers, not {dtype}")
        return dtype.str
    fields = [(name, *(dtype[name].subdtype or (dtype[name], ()))) for name in dtype.names]
    return [[name, _dtype_to_json(base), list(shape)] for name, base, shape in fields]


def _dtype_from_json(described: Any) -> np.dtype[Any]:
    if isinstance(described, str):
        dtype = np.dtype(described)
        if dtype.kind not in "biuf":
            raise ValueError(f"a journal holds numbers, not {dtype}")
        return dtype
    return np.dtype([(name, _dtype_from_json(base), tuple(shape)) for name, base, shape in described])

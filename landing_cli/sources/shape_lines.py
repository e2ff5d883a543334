"""A shape file cut into lines of tokens, a block at a time, so that memory does not follow its size."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from landing_cli.errors import InputRefused
from landing_cli.sources.guarded_file import open_regular

SIZE_CAP_BYTES = 256 * 2**20
LINE_CAP_BYTES = 4096
_BLOCK_BYTES = 2**20

_BATCH_ROWS = 20_000

Tokens = list[bytes]
Row = tuple[int, Tokens]


class ShapeLines:
    """The lines of one file, read once.

    Parameters
    ----------
    path : Path
        File to read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._digest = hashlib.sha256()

    @property
    def sha256(self) -> str:
        """Hash of the bytes read so far: of the whole file once the blocks are exhausted."""
        return self._digest.hexdigest()

    def where(self, line: int) -> str:
        """Name a line for a message."""
        return f"{self.path}, line {line}"

    def rows(self) -> Iterator[Row]:
        """Cut the file into rows of data; CRLF, blank lines and comments (#) vanish.

        Yields
        ------
        (int, list of bytes)
            Line number (from 1) and tokens.
        """
        for first, texts in self._blocks():
            for number, text in enumerate(texts, first):
                tokens = text.split()
                if tokens and not tokens[0].startswith(b"#"):
                    yield number, tokens

    def _blocks(self) -> Iterator[tuple[int, list[bytes]]]:
        line, rest, total = 1, b"", 0
        with open_regular(self.path, SIZE_CAP_BYTES) as stream:
            while block := stream.read(_BLOCK_BYTES):
                self._digest.update(block)
                if total == 0:
                    block = block.removeprefix(b"\xef\xbb\xbf")
                total += len(block)
                if total > SIZE_CAP_BYTES:
                    raise InputRefused("grows while it is read", where=str(self.path))
                texts = (rest + block).split(b"\n")
                rest = texts.pop()
                self._refuse_long(line, [*texts, rest])
                yield line, texts
                line += len(texts)
        yield line, [rest]

    def _refuse_long(self, first: int, lines: list[bytes]) -> None:
        if len(max(lines, key=len)) <= LINE_CAP_BYTES:
            return
        at = next(i for i, text in enumerate(lines) if len(text) > LINE_CAP_BYTES)
        raise InputRefused(
            f"is longer than {LINE_CAP_BYTES} bytes", where=self.where(first + at), fix="is this a text file?"
        )


def batches(rows: Iterator[Row]) -> Iterator[list[Row]]:
    """Group rows, so that each group is converted at once."""
    while batch := list(islice(rows, _BATCH_ROWS)):
        yield batch

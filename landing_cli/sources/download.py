"""Fetching one file from the network on the user's wish: capped, hashed, whole or not at all."""

from __future__ import annotations

import hashlib
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO
from urllib.parse import unquote, urlsplit

from landing_cli.errors import InputRefused, OutputRefused, UsageError
from landing_cli.sources.guarded_file import open_regular
from landing_cli.sources.whole_file import write_whole

SIZE_CAP_BYTES = 256 * 2**20
TIMEOUT_S = 30.0
_FILE_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,120}")
_SHA256 = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True)
class Fetched:
    """A file that was fetched now or earlier.

    Attributes
    ----------
    path : Path
    sha256 : str
    fresh : bool
        True when it was downloaded now.
    """

    path: Path
    sha256: str
    fresh: bool


class _TooLarge(Exception):
    pass


class _CappedFile:
    """A file that refuses to grow beyond a size."""

    def __init__(self, stream: BinaryIO, cap_bytes: int) -> None:
        self._stream = stream
        self._left = cap_bytes

    def write(self, chunk: bytes) -> None:
        self._left -= len(chunk)
        if self._left < 0:
            raise _TooLarge
        self._stream.write(chunk)

    def flush(self) -> None:
        self._stream.flush()


def fetch_file(
    url: str,
    folder: Path,
    *,
    sha256: str | None = None,
    published_hash: str | None = None,
    force: bool = False,
    cap_bytes: int = SIZE_CAP_BYTES,
) -> Fetched:
    """Download a file into a folder, unless it is there already and its hash is right.

    Parameters
    ----------
    url : str
        http or https; its last part names the file.
    folder : Path
        Created if missing.
    sha256 : str, optional
        What the user expects.
    published_hash : str, optional
        What the archive publishes, as ``algorithm:hex``; asked of a fresh download only.
    force : bool
        Download again and forget the recorded hash.
    cap_bytes : int
        Largest size accepted.

    Returns
    -------
    Fetched
        The hash is recorded beside the file, in ``<file>.sha256``, on first use, and held to afterwards.

    Raises
    ------
    UsageError
        If the URL or the hash is none.
    InputRefused
        If the server cannot be reached or says no, the file is too large, or a hash is wrong.
    OutputRefused
        If the folder cannot be written.
    """
    path = folder / _file_name(url)
    if sha256 is not None and not _SHA256.fullmatch(sha256 := sha256.lower()):
        raise UsageError(f"{sha256[:80]!r} is no SHA-256", fix="give 64 hexadecimal digits")
    recorded = None if force else _recorded(path)
    expected = sha256 or recorded
    if path.exists() and not force:
        return _held_to(path, expected)
    made = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".fetch-", dir=folder) as scratch:
            arrived = Path(scratch) / path.name
            _download(url, arrived, published_hash, cap_bytes)
            found = _sha256_of(arrived, cap_bytes)
            if expected is not None and found != expected:
                raise _wrong_hash(url, found, expected)
            arrived.replace(path)
        write_whole(_record_path(path), f"{found}  {path.name}\n".encode())
    except OSError as error:
        raise OutputRefused(f"cannot be written: {error.strerror or error}", where=str(folder)) from error
    finally:
        if made and folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
    return Fetched(path, found, fresh=True)


def _file_name(url: str) -> str:
    try:
        parts = urlsplit(url)
        host = parts.hostname
    except ValueError as error:
        raise UsageError(f"is no URL: {error}", where=url) from error
    if parts.scheme not in ("http", "https") or not host:
        raise UsageError("is no http or https URL", where=url)
    name = unquote(parts.path).rsplit("/", 1)[-1]
    if not _FILE_NAME.fullmatch(name):
        raise UsageError(
            f"names no file that could be written (its last part is {name[:80]!r})",
            where=url,
            fix="download it by hand and use `landing shapes import`",
        )
    return name


def _record_path(path: Path) -> Path:
    return path.with_name(f"{path.name}.sha256")


def _recorded(path: Path) -> str | None:
    """Return the hash that an earlier fetch recorded."""
    record = _record_path(path)
    if not record.exists():
        return None
    with open_regular(record, 4096) as stream:
        found = stream.read(64).decode("ascii", "replace")
    if not _SHA256.fullmatch(found):
        raise InputRefused("holds no SHA-256", where=str(record), fix="delete it, or use --force")
    return found


def _held_to(path: Path, expected: str | None) -> Fetched:
    found = _sha256_of(path, SIZE_CAP_BYTES)
    if expected is None:
        raise InputRefused(
            "is there already, and nothing says which file it should be",
            where=str(path),
            fix="give its --sha256, or --force to download it again",
        )
    if found != expected:
        raise InputRefused(
            f"its sha256 {found} is not {expected}", where=str(path), fix="--force downloads it again"
        )
    return Fetched(path, found, fresh=False)


def _sha256_of(path: Path, cap_bytes: int) -> str:
    digest = hashlib.sha256()
    with open_regular(path, cap_bytes) as stream:
        while block := stream.read(2**20):
            digest.update(block)
    return digest.hexdigest()


def _wrong_hash(url: str, found: str, expected: str) -> InputRefused:
    return InputRefused(
        f"what arrived has sha256 {found}, not {expected}",
        where=url,
        fix="the file has changed, or was changed on its way: look at it before you trust it",
    )


def _download(url: str, path: Path, published_hash: str | None, cap_bytes: int) -> None:
    import pooch
    from requests import RequestException

    def capped(address: str, output_file: str, mirror: object) -> None:
        with Path(output_file).open("wb") as stream:
            get = pooch.HTTPDownloader(chunk_size=2**16, timeout=TIMEOUT_S)
            get(address, _CappedFile(stream, cap_bytes), mirror)

    pooch.get_logger().setLevel("ERROR")  # what happens is told by the command
    try:
        pooch.retrieve(url, published_hash, fname=path.name, path=path.parent, downloader=capped)
    except _TooLarge:
        raise InputRefused(f"sends more than {cap_bytes / 2**20:.0f} MiB", where=url) from None
    except RequestException as error:
        raise InputRefused(
            f"cannot be downloaded: {_reason(error)}",
            where=url,
            fix="is this machine online? A file fetched by hand is read by `landing shapes import`",
        ) from error
    except ValueError as error:  # pooch's word for a hash that differs
        raise InputRefused(
            f"what arrived does not have the published hash {published_hash}",
            where=url,
            fix="the file has changed, or was changed on its way",
        ) from error


def _reason(error: Exception) -> str:
    """Tell a network failure in a few words: the innermost cause says it best."""
    response = getattr(error, "response", None)
    if response is not None:
        return f"the server answers {response.status_code} {response.reason}"
    cause: BaseException = error
    while (inner := getattr(cause, "reason", None) or cause.__context__) and isinstance(inner, BaseException):
        cause = inner
    text = getattr(cause, "strerror", None) or str(cause)
    return f"{type(cause).__name__}: {text}"[:200]

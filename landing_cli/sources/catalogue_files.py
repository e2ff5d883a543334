"""Catalogues of minor planets, read strictly: MPCORB fixed width, MPC extended JSON, SBDB CSV; also gzipped.

The format is told by the content, not by the name. Bad rows are skipped, counted and named; a file that is no
catalogue, or mixes formats, is refused.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import zlib
from pathlib import Path

from landing_cli.errors import InputRefused
from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.sources.catalogue_rows import Origin, assemble
from landing_cli.sources.guarded_file import open_regular

SIZE_CAP_BYTES = 256 * 2**20
UNPACKED_CAP_BYTES = 768 * 2**20
_GZIP = b"\x1f\x8b"


def read_catalogue(path: Path) -> Catalogue:
    """Read a catalogue of minor planets.

    Parameters
    ----------
    path : Path
        MPCORB fixed width, the MPC's extended JSON, or a CSV of JPL's small-body database; plain or gzipped.

    Returns
    -------
    Catalogue
        Orbits in SI, ecliptic and equinox J2000; what was skipped is named in ``bad_rows``.

    Raises
    ------
    InputRefused
        If the file cannot be read, is of no known format or of several, holds a hyperbolic orbit, or more bad
        rows than good ones.
    """
    with open_regular(path, SIZE_CAP_BYTES) as stream:
        data = stream.read(SIZE_CAP_BYTES + 1)
    digest = hashlib.sha256(data).hexdigest()
    text = _unpacked(path, data).removeprefix(b"\xef\xbb\xbf")
    head = text[:4096].lstrip()
    if not head:
        raise InputRefused("is empty", where=str(path))
    if b"\0" in head:
        raise InputRefused("is no text", where=str(path), fix="give a catalogue, plain or gzipped")
    if head[:1] in b"[{":
        from landing_cli.sources.catalogue_json import json_rows

        return assemble(json_rows(text, str(path)), Origin(str(path), path.name, digest, "entry"))
    origin = Origin(str(path), path.name, digest, "line")
    if b"," in _first_line(head):
        from landing_cli.sources.catalogue_csv import csv_rows

        return assemble(csv_rows(text, str(path)), origin)
    from landing_cli.sources.catalogue_fixed import fixed_rows

    return assemble(fixed_rows(text, str(path)), origin)


def _first_line(head: bytes) -> bytes:
    """Find the first line that is no comment: MPCORB's preamble has commas, but never in its first line."""
    lines = (line for line in head.splitlines() if line.strip() and not line.startswith(b"#"))
    return next(lines, b"")


def _unpacked(path: Path, data: bytes) -> bytes:
    if not data.startswith(_GZIP):
        return data
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as stream:
            text = stream.read(UNPACKED_CAP_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InputRefused(
            f"is no whole gzip file: {error}", where=str(path), fix="download it again"
        ) from error
    if len(text) > UNPACKED_CAP_BYTES:
        raise InputRefused(f"unpacks to more than {UNPACKED_CAP_BYTES >> 20} MiB", where=str(path))
    return text

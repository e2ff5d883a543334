"""The Sun, the planets, the Earth and the Moon over a flight, as Chebyshev pieces that kernels evaluate.

Heliocentric, ecliptic and equinox J2000: the kernel's ICRF axes turned by the IAU 1976 obliquity of
84381.448", which the Minor Planet Center's elements refer to (the 0.02" between the ICRF and the equinox of
J2000 are left out).
All bodies share their pieces, so one set of Chebyshev polynomials serves them all.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.errors import InputRefused
from landing_cli.flight.astronomy import GM_SUN_M3_S2, OBLIQUITY_RAD
from landing_cli.kernel import kernel, part
from landing_cli.kernel_record import by_reference
from landing_cli.sources.ephemeris_kernel import EARTH, EARTH_MOON, MOON, SUN, EphemerisSpan, read_span

FloatArray = NDArray[np.float64]

# DE440 (Park et al. 2021), m3/s2, systems with their moons
GM_M3_S2 = {
    "Earth": 3.986_004_355_070_226_6e14,
    "Moon": 4.902_800_118_457_549_6e12,
    "Mercury": 2.203_186_855_140_000_3e13,
    "Venus": 3.248_585_920_000_000_0e14,
    "Mars": 4.282_837_581_575_610_2e13,
    "Jupiter": 1.267_127_641_000_000_0e17,
    "Saturn": 3.794_058_484_180_000_0e16,
    "Uranus": 5.794_556_400_000_000_0e15,
    "Neptune": 6.836_527_100_580_399e15,
}
BODIES = tuple(GM_M3_S2)
EARTH_ROW, MOON_ROW = 0, 1
_BARYCENTRE = {"Mercury": 1, "Venus": 2, "Mars": 4, "Jupiter": 5, "Saturn": 6, "Uranus": 7, "Neptune": 8}
_DROPPED = 4e-15  # Chebyshev terms below this share of the largest are rounding


@by_reference
class Ephemeris(NamedTuple):
    """Where the bodies are over a span of time.

    Attributes
    ----------
    start_s, end_s : float, s
        TDB seconds past J2000: the span that is covered.
    piece_s : float, s
        Length of the pieces.
    terms : (b + 1,) int
        How many Chebyshev terms each row of the coefficients has.
    coefficients : (p, b + 1, k, 3) float
        Chebyshev coefficients of the heliocentric positions, m, ecliptic and equinox J2000; in the last row
        (m/s2) of what the bodies' pull at the Sun adds to a heliocentric acceleration.
    gm : (b,) float, m3/s2
        Gravitational parameters, in the order of `BODIES`.
    gm_sun : float, m3/s2
    """

    start_s: float
    end_s: float
    piece_s: float
    terms: NDArray[np.int64]
    coefficients: FloatArray
    gm: FloatArray
    gm_sun: float


@part
def body_positions(ephemeris: Ephemeris, t: float, ahead: float, out: FloatArray) -> None:
    """Heliocentric positions of all bodies at a time, and the acceleration of the frame.

    Parameters
    ----------
    ephemeris : Ephemeris
        Over a span of time.
    t, ahead : float, s
        The time is their sum, TDB seconds past J2000. A step's start and what lies ahead of it come apart:
        their sum is rounded to 0.1 microseconds, in which the Earth flies millimetres.
    out : (b + 1, 3) float, m
        Receives them, and in the last row (m/s2) what the bodies' pull at the Sun adds to a heliocentric
        acceleration; NaN outside the span.
    """
    elapsed = (t - ephemeris.start_s) + ahead
    if not (elapsed >= 0.0 and t + ahead <= ephemeris.end_s):
        out[:] = math.nan
        return
    place = min(int(elapsed / ephemeris.piece_s), ephemeris.coefficients.shape[0] - 1)
    x = 2.0 * ((t - (ephemeris.start_s + place * ephemeris.piece_s)) + ahead) / ephemeris.piece_s - 1.0
    for row in range(ephemeris.terms.shape[0]):  # Clenshaw's recurrence, an axis each
        u = v = w = u_before = v_before = w_before = 0.0
        for k in range(ephemeris.terms[row] - 1, 0, -1):
            u, u_before = ephemeris.coefficients[place, row, k, 0] + 2.0 * x * u - u_before, u
            v, v_before = ephemeris.coefficients[place, row, k, 1] + 2.0 * x * v - v_before, v
            w, w_before = ephemeris.coefficients[place, row, k, 2] + 2.0 * x * w - w_before, w
        out[row, 0] = ephemeris.coefficients[place, row, 0, 0] + x * u - u_before
        out[row, 1] = ephemeris.coefficients[place, row, 0, 1] + x * v - v_before
        out[row, 2] = ephemeris.coefficients[place, row, 0, 2] + x * w - w_before


@kernel
def body_states(ephemeris: Ephemeris, body: int, t: FloatArray, out: FloatArray) -> None:
    """Heliocentric positions and velocities of one body.

    Parameters
    ----------
    ephemeris : Ephemeris
        Over a span of time.
    body : int
        Its row in `BODIES`.
    t : (n,) float, s
        TDB seconds past J2000.
    out : (n, 6) float, m and m/s
        Receives them; NaN outside the span.
    """
    for i in range(t.shape[0]):
        if not ephemeris.start_s <= t[i] <= ephemeris.end_s:
            out[i] = math.nan
            continue
        place = min(int((t[i] - ephemeris.start_s) / ephemeris.piece_s), ephemeris.coefficients.shape[0] - 1)
        x = 2.0 * (t[i] - ephemeris.start_s - place * ephemeris.piece_s) / ephemeris.piece_s - 1.0
        before, now = x, 1.0
        slope_before, slope = 1.0, 0.0
        out[i] = 0.0
        for k in range(ephemeris.terms[body]):
            for axis in range(3):
                coefficient = ephemeris.coefficients[place, body, k, axis]
                out[i, axis] += now * coefficient
                out[i, 3 + axis] += 2.0 / ephemeris.piece_s * slope * coefficient
            slope_before, slope = slope, 2.0 * now + 2.0 * x * slope - slope_before
            before, now = now, 2.0 * x * now - before


def flight_ephemeris(kernel_name: str, start_t_s: float, end_t_s: float) -> Ephemeris:
    """Copy what a flight needs out of a kernel.

    Parameters
    ----------
    kernel_name : str
        ``DE440``, or the path of a planetary SPK file.
    start_t_s, end_t_s : float, s
        TDB seconds past J2000; the orbits' epochs belong to the span where they are flown from there.

    Returns
    -------
    Ephemeris

    Raises
    ------
    InputRefused
        If the extra is missing, the file is no planetary kernel, or the span is outside it.
    """
    return ephemeris_of(read_span(kernel_name, start_t_s, end_t_s))


def ephemeris_of(span: EphemerisSpan) -> Ephemeris:
    """Fit Chebyshev pieces to heliocentric positions.

    Within a piece every segment is a polynomial, of no higher degree than the nodes carry: the fit is exact
    to rounding. So is that of the frame's acceleration, which changes over weeks.

    Parameters
    ----------
    span : EphemerisSpan
        Samples of a kernel.

    Returns
    -------
    Ephemeris
    """
    positions = _heliocentric(span)  # (p, nodes, b, 3)
    gm = np.array([GM_M3_S2[name] for name in BODIES])
    pull = gm[:, None] * positions / np.linalg.norm(positions, axis=3, keepdims=True) ** 3
    rows = np.concatenate([positions, -pull.sum(axis=2, keepdims=True)], axis=2)
    coefficients = _chebyshev(rows).swapaxes(1, 2)  # (p, b + 1, k, 3)
    size = np.abs(coefficients).max(axis=(0, 3))
    terms = np.array([np.flatnonzero(row > _DROPPED * row[0])[-1] + 1 for row in size], dtype=np.int64)
    return Ephemeris(
        start_s=float(span.edges_s[0]),
        end_s=float(span.edges_s[-1]),
        piece_s=float(span.edges_s[1] - span.edges_s[0]),
        terms=terms,
        coefficients=np.ascontiguousarray(coefficients[:, :, : terms.max()]),
        gm=gm,
        gm_sun=GM_SUN_M3_S2,
    )


def _chebyshev(values: FloatArray) -> FloatArray:
    """Chebyshev coefficients along the second axis, of values at the Chebyshev nodes."""
    nodes = values.shape[1]
    basis = np.cos(np.outer(np.arange(nodes), np.pi * (np.arange(nodes) + 0.5) / nodes)) * 2.0 / nodes
    basis[0] *= 0.5
    return np.einsum("kn,pn...->pk...", basis, values)


def states_of_body(ephemeris: Ephemeris, name: str, t_s: ArrayLike) -> FloatArray:
    """Heliocentric states of one body.

    Parameters
    ----------
    ephemeris : Ephemeris
        Over a span of time.
    name : str
        One of `BODIES`.
    t_s : float or (n,) float, s
        TDB seconds past J2000.

    Returns
    -------
    (n, 6) float, m and m/s
        Ecliptic and equinox J2000.

    Raises
    ------
    InputRefused
        If a time is outside the span.
    """
    t = np.atleast_1d(np.asarray(t_s, dtype=np.float64))
    if not (t.min() >= ephemeris.start_s and t.max() <= ephemeris.end_s):
        span = f"{ephemeris.start_s:.0f} to {ephemeris.end_s:.0f} s"
        raise InputRefused(
            f"{t.min():.0f} to {t.max():.0f} s past J2000 is not within {span}",
            where="ephemeris",
            fix="choose dates within the span that was read",
        )
    out = np.zeros((len(t), 6))
    body_states(ephemeris, BODIES.index(name), t, out)
    return out


def _heliocentric(span: EphemerisSpan) -> FloatArray:
    """Ecliptic positions of all bodies from the Sun, (p, nodes, b, 3)."""
    sun = span.positions_m[0, SUN]
    pair = span.positions_m[0, EARTH_MOON] - sun
    rows = {"Earth": pair + span.positions_m[EARTH_MOON, EARTH]}
    rows["Moon"] = pair + span.positions_m[EARTH_MOON, MOON]
    for name, number in _BARYCENTRE.items():
        rows[name] = span.positions_m[0, number] - sun
    icrf = np.stack([rows[name] for name in BODIES], axis=2)
    cosine, sine = math.cos(OBLIQUITY_RAD), math.sin(OBLIQUITY_RAD)
    x, y, z = icrf[..., 0], icrf[..., 1], icrf[..., 2]
    return np.stack([x, cosine * y + sine * z, cosine * z - sine * y], axis=-1)

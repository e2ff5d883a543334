"""Trajectories as CCSDS Orbit Ephemeris Messages (CCSDS 502.0-B-3, section 5)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.errors import InputRefused
from landing_cli.flight.astronomy import OBLIQUITY_RAD
from landing_cli.flight.trajectory import Trajectory

_J2000 = datetime(2000, 1, 1, 12)


@dataclass(frozen=True, eq=False)
class HeliocentricArc:
    """A coast between two burns.

    Attributes
    ----------
    t_s : (n,) float, s
        TDB seconds past J2000.
    position_m, velocity_m_s : (n, 3) float, m and m/s
        Heliocentric, ecliptic and equinox J2000.
    comment : str
        What the arc is, in one line.
    """

    t_s: NDArray[np.float64]
    position_m: NDArray[np.float64]
    velocity_m_s: NDArray[np.float64]
    comment: str


class _OverAsteroid(Protocol):
    """A run of a landing mission."""

    @property
    def asteroid(self) -> Asteroid:
        """The asteroid."""


def landing_oem(run: _OverAsteroid, flown: Trajectory, scenario: Mapping[str, Any], created_utc: str) -> str:
    """Write a flight of a landing mission as an OEM in the body-fixed frame.

    Parameters
    ----------
    run : run of a landing mission
        It knows the asteroid.
    flown : Trajectory
        The flight.
    scenario : mapping
        The stored scenario, whose body has the epoch.
    created_utc : str
        For the header, ISO 8601.

    Returns
    -------
    str

    Raises
    ------
    InputRefused
        If the scenario has no epoch.
    """
    return to_oem(flown, run.asteroid.name, "lander", scenario["body"].get("epoch_utc"), created_utc)


def to_oem(
    trajectory: Trajectory, body: str, spacecraft: str, epoch_utc: str | None, created_utc: str
) -> str:
    """Write a trajectory as an OEM in the body-fixed frame.

    Parameters
    ----------
    trajectory : Trajectory
        Position about the body's origin and velocity relative to the rotating frame.
    body : str
        Name of the body: the centre, and part of the frame's name (``BENNU_FIXED``). The standard
        leaves frames beyond its own list to the exchange partners; the comments define this one.
    spacecraft : str
        Name of the object.
    epoch_utc : str or None
        UTC of ``t_s = 0``, ISO 8601.
    created_utc : str
        Creation date for the header, ISO 8601.

    Returns
    -------
    str
        Positions in km, velocities in km/s.

    Raises
    ------
    InputRefused
        If the epoch is missing or no ISO 8601 date.
    """
    start = _parsed(epoch_utc)
    centre = body.upper().replace(" ", "_")
    times = [_stamp(start + timedelta(seconds=t)) for t in trajectory.t_s.tolist()]
    comments = (
        f"{centre}_FIXED rotates with the body: origin as in the scenario, z along the spin axis,",
        "x and y as in the shape file. Velocities are relative to this rotating frame.",
    )
    meta = _meta(comments, spacecraft, centre, f"{centre}_FIXED", "UTC", times)
    states = _states(times, trajectory.position_m, trajectory.velocity_m_s)
    return "\n".join([*_header(created_utc), *meta, *states, ""])


def to_heliocentric_oem(arcs: Sequence[HeliocentricArc], spacecraft: str, created_utc: str) -> str:
    """Write an interplanetary flight as an OEM about the Sun, ICRF axes, a segment an arc.

    Parameters
    ----------
    arcs : sequence of HeliocentricArc
        In their order; an impulsive burn stands between two of them.
    spacecraft : str
        Name of the object.
    created_utc : str
        Creation date for the header, ISO 8601.

    Returns
    -------
    str
        Positions in km, velocities in km/s, TDB.
    """
    lines = _header(created_utc)
    for arc in arcs:
        times = [_stamp(_J2000 + timedelta(seconds=t)) for t in arc.t_s.tolist()]
        lines += _meta((arc.comment,), spacecraft, "SUN", "ICRF", "TDB", times)
        lines += [*_states(times, _equatorial(arc.position_m), _equatorial(arc.velocity_m_s)), ""]
    return "\n".join(lines)


def _header(created_utc: str) -> list[str]:
    return [
        "CCSDS_OEM_VERS = 2.0",
        f"CREATION_DATE = {_stamp(_parsed(created_utc))}",
        "ORIGINATOR = LANDING",
        "",
    ]


def _meta(
    comments: Sequence[str], spacecraft: str, centre: str, frame: str, system: str, times: Sequence[str]
) -> list[str]:
    return [
        "META_START",
        *(f"COMMENT {comment}" for comment in comments),
        f"OBJECT_NAME = {spacecraft.upper()}",
        "OBJECT_ID = NONE",
        f"CENTER_NAME = {centre}",
        f"REF_FRAME = {frame}",
        f"TIME_SYSTEM = {system}",
        f"START_TIME = {times[0]}",
        f"STOP_TIME = {times[-1]}",
        "META_STOP",
        "",
    ]


def _states(
    times: Sequence[str], position_m: NDArray[np.float64], velocity_m_s: NDArray[np.float64]
) -> list[str]:
    rows = zip(times, (position_m / 1e3).tolist(), (velocity_m_s / 1e3).tolist(), strict=True)
    return [
        f"{time} {' '.join(f'{x:.12f}' for x in position)} {' '.join(f'{v:.15f}' for v in velocity)}"
        for time, position, velocity in rows
    ]


def _equatorial(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn ecliptic axes of J2000 into those of the ICRF, by the obliquity that they were made with."""
    cosine, sine = math.cos(OBLIQUITY_RAD), math.sin(OBLIQUITY_RAD)
    x, y, z = vectors.T
    return np.column_stack([x, cosine * y - sine * z, sine * y + cosine * z])


def _parsed(text: str | None) -> datetime:
    fix = "set body.epoch_utc in the scenario, as in 2030-05-01T00:00:00"
    if text is None:
        raise InputRefused("an OEM needs the epoch of the initial state", where="body.epoch_utc", fix=fix)
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise InputRefused(f"'{text}' is no ISO 8601 date", where="body.epoch_utc", fix=fix) from error
    return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)


def _stamp(moment: datetime) -> str:
    return moment.strftime("%Y-%m-%dT%H:%M:%S.%f")

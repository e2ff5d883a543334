"""Trajectories as CCSDS Orbit Ephemeris Messages (CCSDS 502.0-B-3, section 5)."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from landing_cli.errors import InputRefused
from landing_cli.flight.trajectory import Trajectory


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
    header = [
        "CCSDS_OEM_VERS = 2.0",
        f"CREATION_DATE = {_stamp(_parsed(created_utc))}",
        "ORIGINATOR = LANDING",
        "",
        "META_START",
        f"COMMENT {centre}_FIXED rotates with the body: origin as in the scenario, z along the spin axis,",
        "COMMENT x and y as in the shape file. Velocities are relative to this rotating frame.",
        f"OBJECT_NAME = {spacecraft.upper()}",
        "OBJECT_ID = NONE",
        f"CENTER_NAME = {centre}",
        f"REF_FRAME = {centre}_FIXED",
        "TIME_SYSTEM = UTC",
        f"START_TIME = {times[0]}",
        f"STOP_TIME = {times[-1]}",
        "META_STOP",
        "",
    ]
    states = zip(
        times, (trajectory.position_m / 1e3).tolist(), (trajectory.velocity_m_s / 1e3).tolist(), strict=True
    )
    lines = [
        f"{time} {' '.join(f'{x:.12f}' for x in position)} {' '.join(f'{v:.15f}' for v in velocity)}"
        for time, position, velocity in states
    ]
    return "\n".join([*header, *lines, ""])


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

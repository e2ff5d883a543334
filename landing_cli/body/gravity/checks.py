"""Refusal of gravity parameters that no body can have."""

from __future__ import annotations

import math

from landing_cli.errors import InputRefused


def checked_number(name: str, value: float, *, above: float = -math.inf, below: float = math.inf) -> float:
    """Return ``value`` as a float strictly between ``above`` and ``below``.

    Parameters
    ----------
    name : str
        The parameter's name, for the message.
    value : float
        The value to check.
    above, below : float
        Open bounds; without them any finite number passes.

    Returns
    -------
    float

    Raises
    ------
    InputRefused
        The value is NaN, infinite or out of bounds.
    """
    number = float(value)
    if not (math.isfinite(number) and above < number < below):
        raise InputRefused(f"{name} is {number:g}", where="gravity", fix=_allowed(above, below))
    return number


def checked_gm(gm_m3_s2: float) -> float:
    """Return GM as a positive, finite float, or raise InputRefused."""
    return checked_number("gm_m3_s2", gm_m3_s2, above=0.0)


def _allowed(above: float, below: float) -> str:
    bounds = [f"above {above:g}"] if math.isfinite(above) else []
    bounds += [f"below {below:g}"] if math.isfinite(below) else []
    return "give a finite number" + (" " + " and ".join(bounds) if bounds else "")

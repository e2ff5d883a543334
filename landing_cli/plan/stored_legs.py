"""Legs of a plan as arrays: in result files and journals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityField
from landing_cli.flight.legs import AccelerationLeg, BezierLeg, GaussAccelerationLeg, LinearAccelerationLeg
from landing_cli.results.tree import Dataset, Group

# what a leg's kind stores
LEG_DATA: Mapping[str, tuple[str, ...]] = {
    "bezier": ("points_m", "duration_s"),
    "linear": ("times_s", "acceleration_m_s2"),
    "gauss": ("edges_s", "acceleration_m_s2"),
}


def kind_of(leg: AccelerationLeg) -> str:
    """Name the kind of a leg, a key of `LEG_DATA`."""
    if isinstance(leg, BezierLeg):
        return "bezier"
    return "linear" if isinstance(leg, LinearAccelerationLeg) else "gauss"


def leg_datasets(leg: AccelerationLeg) -> dict[str, tuple[NDArray[Any], str, str, tuple[str, ...]]]:
    """Array, units, meaning and dimensions of everything that a leg is made of."""
    if isinstance(leg, BezierLeg):
        return {
            "points_m": (leg.points_m, "m", "control points P_0 ... P_n, body frame", ("point", "xyz")),
            "duration_s": (np.array([leg.duration_s]), "s", "time of flight", ("one",)),
        }
    told = "thrust over mass, rotating body frame"
    if isinstance(leg, LinearAccelerationLeg):
        return {
            "times_s": (leg.times_s, "s", "times of the nodes since the start of the leg", ("node",)),
            "acceleration_m_s2": (
                leg.acceleration_m_s2,
                "m s-2",
                f"{told}, linear between nodes",
                ("node", "xyz"),
            ),
        }
    return {
        "edges_s": (leg.edges_s, "s", "ends of the intervals since the start of the leg", ("edge",)),
        "acceleration_m_s2": (
            leg.acceleration_m_s2,
            "m s-2",
            f"{told}, at the Legendre-Gauss nodes of each interval",
            ("interval", "node", "xyz"),
        ),
    }


def leg_to_group(leg: AccelerationLeg) -> Group:
    """Lay a leg out for the store, as `leg_from_group` reads it."""
    return Group({name: Dataset(*parts) for name, parts in leg_datasets(leg).items()}, {"kind": kind_of(leg)})


def leg_from_group(group: Group, gravity: GravityField) -> AccelerationLeg:
    """Rebuild a leg that was planned in a gravity field.

    Parameters
    ----------
    group : Group
        From ``leg_to_group``.
    gravity : GravityField
        The field.

    Raises
    ------
    KeyError, ValueError
        If it is no leg.
    """
    kind = str(group.attributes["kind"])
    return make_leg(kind, {name: group.dataset(name).data for name in LEG_DATA[kind]}, gravity)


def make_leg(kind: str, data: Mapping[str, NDArray[Any] | None], gravity: GravityField) -> AccelerationLeg:
    """Make a leg of the arrays that `leg_datasets` names.

    Parameters
    ----------
    kind : str
        A key of `LEG_DATA`.
    data : mapping of arrays
        By name.
    gravity : GravityField
        The field that it was planned in.

    Raises
    ------
    ValueError
        If an array is missing, or of another shape or type.
    """
    arrays = {}
    for name in LEG_DATA[kind]:
        value = data[name]
        if value is None or value.dtype != np.float64:
            raise ValueError(f"a {kind} leg without {name}")
        arrays[name] = value
    vectors = arrays["points_m"] if kind == "bezier" else arrays["acceleration_m_s2"]
    if vectors.shape[-1] != 3 or vectors.ndim != (3 if kind == "gauss" else 2):
        raise ValueError(f"a {kind} leg of shape {vectors.shape}")
    if kind == "bezier":
        return BezierLeg(float(arrays["duration_s"][0]), vectors, gravity)
    times = arrays["times_s" if kind == "linear" else "edges_s"]
    if times.ndim != 1 or len(times) != len(vectors) + (kind == "gauss"):
        raise ValueError(f"a {kind} leg of {len(vectors)} values at {len(times)} times")
    return LinearAccelerationLeg(times, vectors) if kind == "linear" else GaussAccelerationLeg(times, vectors)

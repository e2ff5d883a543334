"""The asteroid as a group of a result file, whatever the mission."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.mesh import Mesh
from landing_cli.results.body_checks import check_asteroid
from landing_cli.results.tree import Dataset, Group


def body_to_group(asteroid: Asteroid) -> Group:
    """Lay an asteroid out for the store.

    Parameters
    ----------
    asteroid : Asteroid
        Surface, spin and gravity.

    Returns
    -------
    Group
    """
    mesh, gravity = asteroid.mesh, asteroid.gravity
    members = {
        "vertices": Dataset(mesh.vertices, "m", "vertices, body frame", ("vertex", "xyz")),
        "faces": Dataset(mesh.faces, "1", "vertices of each facet, 0-based", ("facet", "corner")),
        "gravity_params": Dataset(gravity.params, "1", "parameters of the gravity model, SI", ("parameter",)),
    }
    return Group(
        members,
        {
            "name": asteroid.name,
            "rotation_rate_rad_s": asteroid.rotation_rate_rad_s,
            "gm_m3_s2": asteroid.gm_m3_s2,
            "gravity": gravity.kind.name.lower(),
        },
    )


def body_from_group(group: Group) -> Asteroid:
    """Rebuild an asteroid.

    Parameters
    ----------
    group : Group
        From ``body_to_group``.

    Returns
    -------
    Asteroid

    Raises
    ------
    KeyError
        If a part is missing.
    ValueError
        If the mesh is none, or a number absurd.
    """
    mesh = Mesh(group.dataset("vertices").data, group.dataset("faces").data)
    kind = GravityKind[str(group.attributes["gravity"]).upper()]
    asteroid = Asteroid(
        str(group.attributes["name"]),
        mesh,
        number(group, "rotation_rate_rad_s"),
        GravityField(kind, group.dataset("gravity_params").data),
        number(group, "gm_m3_s2"),
    )
    check_asteroid(asteroid)
    return asteroid


def number(group: Group, name: str) -> float:
    """Return an attribute that must be a number, or raise ValueError."""
    value = group.attributes[name]
    if not isinstance(value, int | float):
        raise ValueError(f"{name} is no number")
    return value


def vector(group: Group, name: str) -> NDArray[np.float64]:
    """Return an attribute that must be a (3,) vector, or raise ValueError."""
    value = group.attributes[name]
    if not isinstance(value, np.ndarray) or value.shape != (3,):
        raise ValueError(f"{name} is no vector")
    return value.astype(np.float64)

"""Whether a stored body and spacecraft can be true: what compiled code takes for granted of every file."""

from __future__ import annotations

from typing import Any

import numpy as np

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.kernel_types import FloatArray
from landing_cli.body.gravity.surrounding_checks import is_sound
from landing_cli.body.mesh import facet_areas
from landing_cli.flight.spacecraft import Spacecraft

# what a scenario may ask for at most
_LARGEST = {
    "gm_m3_s2": 1e15,
    "mass_kg": 1e7,
    "thrust_max_n": 1e7,
    "isp_s": 1e6,
    "propellant_kg": 1e7,
    "vertices": 1e9,
    "rotation_rate_rad_s": 0.2,
    "gravity_params": 1e33,
}
_PARAMETERS = {GravityKind.POINT_MASS: 1, GravityKind.HARMONICS: 7, GravityKind.DIPOLE: 6}


def check_asteroid(asteroid: Asteroid) -> None:
    """Hold an asteroid's arrays to what the kernels read without looking.

    Parameters
    ----------
    asteroid : Asteroid
        As it was read.

    Raises
    ------
    ValueError
        If an index leads out of an array, or a number is not finite.
    """
    mesh = asteroid.mesh
    if mesh.vertices.shape[1:] != (3,) or mesh.faces.shape[1:] != (3,) or not len(mesh.faces):
        raise ValueError("the body's mesh is no list of triangles")
    if not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices):
        raise ValueError("a facet refers to a vertex that does not exist")
    bounded("vertices", mesh.vertices, _LARGEST["vertices"])
    if not facet_areas(mesh).min() > 0.0:
        raise ValueError("a facet has no area")
    positive("gm_m3_s2", asteroid.gm_m3_s2, _LARGEST["gm_m3_s2"])
    bounded("rotation_rate_rad_s", asteroid.rotation_rate_rad_s, _LARGEST["rotation_rate_rad_s"])
    if asteroid.rotation_rate_rad_s < 0.0:
        raise ValueError("rotation_rate_rad_s is negative: +z is the axis of the spin")
    _check_gravity(asteroid.gravity)


def check_spacecraft(craft: Spacecraft) -> None:
    """Hold a spacecraft to positive numbers.

    Parameters
    ----------
    craft : Spacecraft
        As it was read.

    Raises
    ------
    ValueError
        If a number is not positive and finite.
    """
    for name, value in vars(craft).items():
        if value is not None:
            if not isinstance(value, int | float):
                raise ValueError(f"{name} is no number")
            positive(name, value, _LARGEST[name])


def bounded(name: str, values: Any, largest: float) -> None:
    """Refuse what is no number, or an absurd one.

    Parameters
    ----------
    name : str
        For the message.
    values : number or array
        Of any shape.
    largest : float
        Largest magnitude allowed.

    Raises
    ------
    ValueError
        If a value is no finite number, or beyond it.
    """
    array = np.asarray(values)
    if array.dtype.kind not in "iuf" or not (np.abs(array) <= largest).all():
        raise ValueError(f"{name} holds what is no number, or an absurd one")


def positive(name: str, values: Any, largest: float) -> None:
    """Refuse what is not positive, as `bounded` refuses what is no number."""
    bounded(name, values, largest)
    if not (np.asarray(values) > 0.0).all():
        raise ValueError(f"{name} is not positive")


def _check_gravity(field: GravityField) -> None:
    params = field.params
    bounded("gravity_params", params, _LARGEST["gravity_params"])
    if field.kind is GravityKind.POLYHEDRON:
        fits = _is_polyhedron(params)
    elif field.kind is GravityKind.INTERPOLATED:
        fits = is_sound(params) and _is_polyhedron(params[int(params[0]) :])
    else:
        fits = len(params) == _PARAMETERS.get(field.kind, -1)  # a body's own field holds in no box alone
    if not fits:
        raise ValueError(f"{len(params)} gravity parameters do not fit the model {field.kind.name.lower()}")


def _is_polyhedron(params: FloatArray) -> bool:
    sizes = params[:2] if len(params) >= 3 else np.array([-1.0])
    expected = 3 + 27 * sizes[0] + 20 * sizes[-1]  # the records of polyhedron_records
    return bool((sizes >= 0).all() and (sizes == np.floor(sizes)).all() and len(params) == expected)

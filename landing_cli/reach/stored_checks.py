"""Whether a stored run can be true: what compiled code and printers take for granted, asked of every file."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.records import FACET_COLUMNS, FacetSolutions, LandingCase
from landing_cli.reach.summary import summarise
from landing_cli.results.tree import Dataset, Group

if TYPE_CHECKING:
    from landing_cli.reach.stored import CaseResult

# what a scenario may ask for at most, or an answer to one may be
_LARGEST = {
    "gm_m3_s2": 1e15,
    "mass_kg": 1e7,
    "thrust_max_n": 1e7,
    "isp_s": 1e6,
    "propellant_kg": 1e7,
    "tof_s": 1e7,
    "final_stage_s": 1e7,
    "position_m": 1e9,
    "velocity_m_s": 1e6,
    "ellipsoid_m": 1e9,
    "vertices": 1e9,
    "rotation_rate_rad_s": 1.0,
    "gravity_params": 1e33,
    "handover_position_m": 1e9,
    "handover_velocity_m_s": 1e6,
    "costates": 1e12,
    "thrust_nodes_n": 1e7,
}
_PARAMETERS = {GravityKind.POINT_MASS: 1, GravityKind.HARMONICS: 7, GravityKind.DIPOLE: 6}
_CHOICES = {n: get_args(h) for n, h in get_type_hints(LandingCase).items() if get_origin(h) is Literal}


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
    _bounded("vertices", mesh.vertices)
    _positive("gm_m3_s2", asteroid.gm_m3_s2)
    _bounded("rotation_rate_rad_s", asteroid.rotation_rate_rad_s)
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
            _positive(name, value)


def check_case(result: CaseResult) -> None:
    """Hold a case to what can have been asked and answered.

    Parameters
    ----------
    result : CaseResult
        As it was read.

    Raises
    ------
    ValueError
        If a quantity is impossible, a choice unknown, or a facet not of this body.
    """
    case, facets = result.case, len(result.case.asteroid.mesh.faces)
    for name in ("tof_s", "final_stage_s", "ellipsoid_m"):
        _positive(name, getattr(case, name))
    if not case.descent_s > 0.0:
        raise ValueError("final_stage_s is longer than tof_s")
    if not 0.0 < case.glide_slope_half_angle_rad <= pi / 2:
        raise ValueError("glide_slope_half_angle_rad is not between 0 and pi/2")
    for name in ("position_m", "velocity_m_s"):
        _bounded(name, getattr(case, name))
    for name, allowed in _CHOICES.items():
        if getattr(case, name) not in allowed:
            raise ValueError(f"{name} is none of {', '.join(allowed)}")
    check_rows(result.solutions, facets)
    _all_within("lost", np.array(list(result.lost), dtype=np.int64), facets)
    if result.boundary is not None:
        _check_boundary(result.boundary, facets)
    _check_printable("summary", result.summary)
    _check_summary(result.summary, summarise(case.asteroid.mesh, result.solutions))


def check_rows(solutions: FacetSolutions, facets: int) -> None:
    """Hold rows to facets that exist, each once, ascending, and to enumerations that are known.

    Parameters
    ----------
    solutions : FacetSolutions
        Rows whose types have been checked.
    facets : int
        How many there are.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """
    rows = solutions.rows
    _all_within("facet", rows["facet"], facets)
    if (np.diff(rows["facet"].astype(np.int64)) <= 0).any():
        raise ValueError("the facets do not ascend")
    if (rows["thrust_nodes"] < 0).any():
        raise ValueError("a facet has a negative number of thrust nodes")
    _bounded("thrust_nodes_n", solutions.thrust_nodes_n)
    for column in FACET_COLUMNS:
        if column.name in _LARGEST:
            _bounded(column.name, np.nan_to_num(rows[column.name], nan=0.0, posinf=np.inf, neginf=-np.inf))
        if column.flags is not None and not np.isin(rows[column.name], list(column.flags)).all():
            raise ValueError(f"{column.name} holds a value without a meaning")


def _check_gravity(field: GravityField) -> None:
    params = field.params
    _bounded("gravity_params", params)
    if field.kind is GravityKind.POLYHEDRON:
        sizes = params[:2] if len(params) >= 3 else np.array([-1.0])
        expected = 3 + 27 * sizes[0] + 20 * sizes[-1]  # the records of polyhedron_records
        fits = (sizes >= 0).all() and (sizes == np.floor(sizes)).all() and len(params) == expected
    else:
        fits = len(params) == _PARAMETERS[field.kind]
    if not fits:
        raise ValueError(f"{len(params)} gravity parameters do not fit the model {field.kind.name.lower()}")


def _check_boundary(boundary: Group, facets: int) -> None:
    """Lists of facets, or one number a facet."""
    for name, member in boundary.members.items():
        if not isinstance(member, Dataset) or member.data.ndim != 1:
            raise ValueError(f"boundary/{name} is no list")
        if name == "domain" and len(member.data) != facets:
            raise ValueError("the domain does not tell of every facet")
        if member.data.dtype.kind in "iu":
            _all_within(f"boundary/{name}", member.data, facets)


def _check_summary(stored: Mapping[str, Any], known: Mapping[str, Any], path: str = "summary") -> None:
    """Every number that is printed is there, and is a number."""
    for name, value in known.items():
        if name not in stored:
            raise ValueError(f"{path} lacks {name}")
        found = stored[name]
        if isinstance(value, Mapping):
            if not isinstance(found, Mapping):
                raise ValueError(f"{path}/{name} is no group")
            _check_summary(found, value, f"{path}/{name}")
        elif not (found is None or isinstance(found, int | float)):
            raise ValueError(f"{path}/{name} is no number")


def _check_printable(path: str, values: Mapping[str, Any]) -> None:
    """Nothing but numbers, words and groups of them."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            _check_printable(f"{path}/{name}", value)
        elif not (value is None or isinstance(value, int | float | str)):
            raise ValueError(f"{path}/{name} is neither number nor word")


def _bounded(name: str, values: Any) -> None:
    array = np.asarray(values)
    if array.dtype.kind not in "iuf" or not (np.abs(array) <= _LARGEST[name]).all():
        raise ValueError(f"{name} holds what is no number, or an absurd one")


def _positive(name: str, values: Any) -> None:
    _bounded(name, values)
    if not (np.asarray(values) > 0.0).all():
        raise ValueError(f"{name} is not positive")


def _all_within(name: str, indices: NDArray[Any], count: int) -> None:
    if indices.dtype.kind not in "iu" or (indices.size and not 0 <= indices.min() <= indices.max() < count):
        raise ValueError(f"{name} names what does not exist")

"""A first scenario for any body: numbers that follow from its shape, to be replaced by the user's own."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from landing_cli.body.ellipsoid import least_volume_ellipsoid
from landing_cli.body.mass_properties import centred, mass_properties
from landing_cli.body.mesh import Mesh
from landing_cli.scenario.constants import GRAVITATIONAL_CONSTANT
from landing_cli.scenario.schema import from_tree
from landing_cli.scenario.show import to_yaml
from landing_cli.sources.shape_files import read_shape
from landing_cli.sources.shape_search import find_shape

MASS_KG = 1000.0
ISP_S = 300.0
START_HEIGHT_IN_RADII = 1.5
SHORTEST_CROSSING_S = 600.0
THRUST_OVER_WEIGHT = 10.0
# times of flight and final stage, in units of the shortest crossing; as in Zhao 2022 over Bennu
TOF_IN_CROSSINGS = (1.25, 1.6, 2.1)
FINAL_STAGE_IN_CROSSINGS = 0.35
ELONGATED = 1.6


@dataclass(frozen=True)
class BodyFigures:
    """What the shape and the density say.

    Attributes
    ----------
    extents_m : (3,) float, m
    ellipsoid_m : (3,) float, m
        Least-volume semi-axes.
    gm_m3_s2 : float
    """

    extents_m: tuple[float, float, float]
    ellipsoid_m: tuple[float, float, float]
    gm_m3_s2: float

    @property
    def mean_radius_m(self) -> float:
        """Radius of the sphere of the ellipsoid's volume, m."""
        return float(np.cbrt(np.prod(self.ellipsoid_m)))

    @property
    def weight_m_s2(self) -> float:
        """Gravity at the ellipsoid's nearest point, as of a point mass, m/s2."""
        return self.gm_m3_s2 / min(self.ellipsoid_m) ** 2

    @property
    def gravity_model(self) -> str:
        """Return the cheapest model that suits the figure."""
        a, b, c = self.ellipsoid_m
        if max(a, b, c) < ELONGATED * min(a, b, c):
            return "harmonics"
        return "dipole" if a >= max(b, c) else "polyhedron"


def scenario_text(
    name: str, shape: str, length_unit: str, density_kg_m3: float, rotation_period_h: float, folder: Path
) -> str:
    """Write a commented scenario that loads, checks and runs.

    Parameters
    ----------
    name : str
        Of the scenario.
    shape : str
        Shape file: a path, or a name that the shape search finds.
    length_unit : {"km", "m"}
        Of the shape file.
    density_kg_m3 : float
        Assumed for the body, kg/m3.
    rotation_period_h : float
        About +z, h.
    folder : Path
        Where the scenario will be written: the shape is named relative to it.

    Returns
    -------
    str
        YAML.

    Raises
    ------
    InputRefused
        The shape is missing or broken, or a number is out of range.
    """
    named = _relative_to(shape, folder)
    tree: dict[str, Any] = {
        "name": name,
        "body": {
            "shape": named,
            "length_unit": length_unit,
            "rotation_period_h": rotation_period_h,
            "gravity": {"model": "point_mass", "density_kg_m3": density_kg_m3},
        },
        "spacecraft": {"mass_kg": MASS_KG, "thrust_max_n": 1.0, "isp_s": ISP_S},
        "reach": {
            "initial_states": [{"name": "north_pole", "position_m": [0.0, 0.0, 1.0]}],
            "tof_s": [2.0],
            "final_stage_s": 1.0,
        },
    }
    checked = from_tree(tree, source="landing scenario init")  # before the shape is read
    mesh = centred(read_shape(find_shape(named, folder), checked.body.length_unit).mesh)
    figures = _figures(mesh, density_kg_m3)
    tree["body"]["gravity"]["model"] = figures.gravity_model
    return to_yaml(from_tree(_with_flight(tree, figures)), _header(name, figures, density_kg_m3))


def _figures(mesh: Mesh, density_kg_m3: float) -> BodyFigures:
    x, y, z = map(float, np.ptp(mesh.vertices, axis=0))
    a, b, c = map(float, least_volume_ellipsoid(mesh.vertices))
    gm = GRAVITATIONAL_CONSTANT * density_kg_m3 * mass_properties(mesh).volume_m3
    return BodyFigures((x, y, z), (a, b, c), gm)


def _with_flight(tree: dict[str, Any], figures: BodyFigures) -> dict[str, Any]:
    """Put in starts, thrust and times: a crossing from rest to rest takes 2 sqrt(d / a)."""
    a, _, c = figures.ellipsoid_m
    above = START_HEIGHT_IN_RADII * figures.mean_radius_m
    distance = c + above
    acceleration = max(THRUST_OVER_WEIGHT * figures.weight_m_s2, 4.0 * distance / SHORTEST_CROSSING_S**2)
    thrust = _two_digits_up(MASS_KG * acceleration)
    crossing = 2.0 * math.sqrt(distance * MASS_KG / thrust)
    starts = {
        "north_pole": [0.0, 0.0, _two_digits_up(c + above)],
        "equator": [_two_digits_up(a + above), 0.0, 0.0],
    }
    return {
        **tree,
        "spacecraft": {**tree["spacecraft"], "thrust_max_n": thrust},
        "reach": {
            "initial_states": [{"name": name, "position_m": start} for name, start in starts.items()],
            "tof_s": [_two_digits_up(share * crossing) for share in TOF_IN_CROSSINGS],
            "final_stage_s": _two_digits_up(FINAL_STAGE_IN_CROSSINGS * crossing),
        },
    }


def _header(name: str, figures: BodyFigures, density_kg_m3: float) -> str:
    extents = " x ".join(f"{value:.5g}" for value in figures.extents_m)
    axes = " x ".join(f"{value:.5g}" for value in figures.ellipsoid_m)
    times = ", ".join(f"{share:g}" for share in TOF_IN_CROSSINGS)
    return f"""\
{name}: a first scenario, written by `landing scenario init`; replace its numbers by your own.

The body measures {extents} m; its least ellipsoid has the semi-axes
{axes} m.
{density_kg_m3:g} kg/m3 make GM = {figures.gm_m3_s2:.5g} m3/s2, and
{figures.weight_m_s2:.2g} m/s2 at the surface.
The spacecraft starts {START_HEIGHT_IN_RADII:g} mean radii above the ellipsoid, at rest in the rotating frame.
Its thrust is at least {THRUST_OVER_WEIGHT:g} times its weight at the surface. The times of flight are
{times} times the shortest crossing from rest to rest, 2 sqrt(distance mass / thrust).
Keys behind a # are not given; `landing scenario schema` describes all of them for editors.
"""


def _two_digits_up(value: float) -> float:
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit - 1e-9) * unit:.6g}")


def _relative_to(shape: str, folder: Path) -> str:
    """Name an existing file as the scenario will find it; leave other names to the shape search."""
    path = Path(shape)
    if not path.is_file():
        return shape
    relative = os.path.relpath(path.resolve(), folder.resolve())
    return str(path.resolve()) if relative.startswith(os.pardir) else relative

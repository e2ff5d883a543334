"""The asteroid as the solvers see it: surface, spin and gravity."""

from __future__ import annotations

from dataclasses import dataclass

from landing_cli.body.gravity.field import GravityField
from landing_cli.body.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Asteroid:
    """A uniformly rotating body; its spin axis is +z of the body frame.

    Attributes
    ----------
    name : str
    mesh : Mesh
        Surface about the chosen origin (centre of mass unless the scenario says ``file``).
    rotation_rate_rad_s : float
        Spin rate about +z.
    gravity : GravityField
        The field that the solvers fly in.
    gm_m3_s2 : float
        Gravitational parameter.
    """

    name: str
    mesh: Mesh
    rotation_rate_rad_s: float
    gravity: GravityField
    gm_m3_s2: float

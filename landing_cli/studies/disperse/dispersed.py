"""A landing case with a sample's deviations, ready for the solver."""

from __future__ import annotations

from dataclasses import replace

from landing_cli.body.gravity.scaled_field import scaled_field
from landing_cli.reach.certificate import GravityBounds
from landing_cli.reach.free_descent import PreparedCase, prepare
from landing_cli.reach.records import LandingCase
from landing_cli.studies.disperse.records import FloatArray

# r'Re r below 1 by more than this is no rounding: limits are met to a tenth of it.
_INSIDE = 1e-4


def dispersed_case(case: LandingCase, turn: FloatArray, deviation: FloatArray) -> LandingCase:
    """Add a sample's deviations to a case; mesh and ellipsoid stay, and the propellant on board.

    Parameters
    ----------
    case : LandingCase
        Without deviation.
    turn : (3, 3) float
        From `axes.state_axes`.
    deviation : (9,) float, SI
        From `draws.deviations`.

    Returns
    -------
    LandingCase
        All zero, it is the case itself to the last bit.
    """
    asteroid, craft = case.asteroid, case.spacecraft
    gm_m3_s2 = asteroid.gm_m3_s2 + float(deviation[8])
    gravity = scaled_field(asteroid.gravity, gm_m3_s2 / asteroid.gm_m3_s2)
    return replace(
        case,
        asteroid=replace(asteroid, gravity=gravity, gm_m3_s2=gm_m3_s2),
        spacecraft=replace(
            craft,
            mass_kg=craft.mass_kg + float(deviation[6]),
            thrust_max_n=craft.thrust_max_n + float(deviation[7]),
        ),
        position_m=case.position_m + turn.T @ deviation[:3],
        velocity_m_s=case.velocity_m_s + turn.T @ deviation[3:6],
    )


def prepare_dispersed(nominal: PreparedCase, case: LandingCase) -> PreparedCase:
    """Prepare a dispersed case on what was surveyed once, for the nominal one.

    Parameters
    ----------
    nominal : PreparedCase
        The case without deviation.
    case : LandingCase
        From :func:`dispersed_case`.

    Returns
    -------
    PreparedCase
        The bounds of gravity are those of the nominal field, scaled as the field is.
    """
    factor = case.asteroid.gm_m3_s2 / nominal.case.asteroid.gm_m3_s2
    bounds = nominal.shared.bounds
    scaled = GravityBounds(bounds.radius_m, factor * bounds.outside_m_s2, factor * bounds.on_arcs_m_s2)
    return prepare(case, replace(nominal.shared, bounds=scaled))


def begins_inside(case: LandingCase) -> bool:
    """Whether a case begins inside the keep-out ellipsoid by more than any tolerance; no flight mends it."""
    return float(((case.position_m / case.ellipsoid_m) ** 2).sum()) < 1.0 - _INSIDE

"""What would make a facet reachable, in a sentence and as numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from landing_cli.reach.records import LandingCase
from landing_cli.reach.relaxations import UNITS, Kind
from landing_cli.reach.why_not import Searched, WhyNot


def tell_relaxations(case: LandingCase, why: WhyNot) -> str:
    """Say in one sentence what alone would make a facet reachable, the least change first, and what not.

    Parameters
    ----------
    case : LandingCase
        The case.
    why : WhyNot
        Of this one facet.
    """
    changes = why.changes[0]
    scales = np.array([searched.scale for searched in why.searched])
    helping = [k for k in np.argsort(np.abs(changes) / scales) if np.isfinite(changes[k])]
    helpless = [
        _futile(case, searched)
        for searched, change in zip(why.searched, changes, strict=True)
        if np.isnan(change)
    ]
    told = ""
    if helping:
        ways = [_eased(why.searched[k], changes[k]) for k in helping]
        told = f"it would be reachable with {', or '.join(ways)}"
    if helpless:
        told += f"{'; ' if told else ''}{' and '.join(helpless)} alone {'help' if helpless[1:] else 'helps'}"
    return told


def relaxation_facts(why: WhyNot) -> dict[str, Any]:
    """Every thing that was relaxed for a facet: its least change, how finely and how far it was looked for.

    Parameters
    ----------
    why : WhyNot
        Of this one facet.
    """
    facts: dict[str, Any] = {}
    for searched, change in zip(why.searched, why.changes[0], strict=True):
        unit = UNITS[searched.kind]
        facts[searched.kind.value] = {f"change_{unit}": float(change)}
        if searched.kind is not Kind.TERRAIN:
            facts[searched.kind.value] |= {
                f"step_{unit}": searched.step,
                f"searched_from_{unit}": searched.lowest,
                f"searched_to_{unit}": searched.highest,
            }
    easiest = int(why.easiest()[0])
    facts["easiest"] = why.searched[easiest].kind.value if easiest >= 0 else None
    return facts


def _eased(searched: Searched, change: float) -> str:
    size = f"{abs(change):.4g}"
    return {
        Kind.THRUST: f"{size} N more thrust",
        Kind.TIME: f"a flight {size} s {'longer' if change > 0.0 else 'shorter'}",
        Kind.GLIDE_SLOPE: f"a glide slope {size} degrees wider",
        Kind.ELLIPSOID: f"an ellipsoid {size} m smaller on every side",
        Kind.PROPELLANT: f"{size} kg more propellant",
        Kind.TERRAIN: f"a path through {size} m of rock",
    }[searched.kind]


def _futile(case: LandingCase, searched: Searched) -> str:
    angle = np.degrees(case.glide_slope_half_angle_rad)
    propellant = case.spacecraft.propellant_kg or 0.0
    return {
        Kind.THRUST: f"no thrust up to {case.spacecraft.thrust_max_n + searched.highest:.4g} N",
        Kind.TIME: f"no time of flight from {case.tof_s + searched.lowest:.4g} "
        f"to {case.tof_s + searched.highest:.4g} s",
        Kind.GLIDE_SLOPE: f"no glide slope up to {angle + searched.highest:.4g} degrees",
        Kind.ELLIPSOID: f"no ellipsoid smaller by up to {searched.highest:.4g} m",
        Kind.PROPELLANT: f"no propellant up to {propellant + searched.highest:.4g} kg",
        Kind.TERRAIN: "no path through rock",
    }[searched.kind]

"""A first scenario of a flyby tour: from the Hill sphere of the Earth, to be replaced by the user's own."""

from __future__ import annotations

from typing import Any

from landing_cli.scenario.schema import tour_from_tree
from landing_cli.scenario.show import to_yaml

HILL_RADIUS_KM = 1.5e6
SPEED_M_S = 400.0
_HEADER = """\
{name}: a first tour, written by `landing scenario init --tour`; replace its numbers by your own.

The spacecraft leaves the Earth at the edge of its Hill sphere, away from the Sun at {speed:g} m/s. The list
that is shipped holds ten asteroids with orbits of 2019: `landing tour fetch` brings the full list, and
`tour search {name}.yaml --catalogue catalog/NEA.txt` searches it.
Keys behind a # are not given; `landing scenario schema` describes all of them for editors.
"""


def tour_text(name: str) -> str:
    """Write a commented scenario of a tour that loads, checks and runs.

    Parameters
    ----------
    name : str
        Of the scenario.

    Returns
    -------
    str
        YAML.

    Raises
    ------
    InputRefused
        The name is out of range.
    """
    tree: dict[str, Any] = {
        "name": name,
        "tour": {
            "departure": {
                "epoch_utc": "2021-04-08T12:00:00",
                "distance_km": HILL_RADIUS_KM,
                "sun_angle_deg": 180.0,
                "radial_speed_m_s": SPEED_M_S,
            },
            "targets": {"exclude": ["2014 NQ64"]},  # its orbit is that of a single day
            "limits": {"delta_v_m_s": 600.0, "end_utc": "2022-12-31T00:00:00"},
        },
    }
    scenario = tour_from_tree(tree, source="landing scenario init")
    return to_yaml(scenario, _HEADER.format(name=name, speed=SPEED_M_S))

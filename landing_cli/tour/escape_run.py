"""`tour escape`: maps over altitudes, two orbits flown in N-body, the file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from landing_cli import __version__
from landing_cli.results.identity import RunIdentity
from landing_cli.results.output import finish_output, open_output
from landing_cli.results.provenance import Stopwatch
from landing_cli.results.store import read
from landing_cli.scenario.load import LoadedTour
from landing_cli.scenario.schema_tour import EarthOrbits, EscapeSection, MoonOrbits
from landing_cli.scenario.show import section_to_yaml
from landing_cli.tour.ephemeris import GM_M3_S2
from landing_cli.tour.escape import escape_increment, fly_escapes
from landing_cli.tour.escape_records import EscapeMap, EscapeRun
from landing_cli.tour.pipeline import Outcome, RunOptions
from landing_cli.tour.stored import MISSION, run_from_result, run_to_tree

EARTH_RADIUS_M = 6_378_136.6  # IAU 2015, equatorial
MOON_RADIUS_M = 1_737_400.0
WITHOUT_SCENARIO = "liu2023"


@dataclass(frozen=True)
class EscapeRequest:
    """What `tour escape` is asked.

    Attributes
    ----------
    name : str
        Of the scenario.
    section : EscapeSection
    ephemeris : str
        Kernel of the two flights.
    """

    name: str
    section: EscapeSection
    ephemeris: str

    def asked(self) -> dict[str, Any]:
        """Return the ranges by name, for `--dry-run`."""
        told = {
            f"{body}_{key}": list(value)
            for body in ("moon", "earth")
            for key, value in getattr(self.section, body)
        }
        return {**told, "points": self.section.points, "ephemeris": self.ephemeris}


def escape_request(loaded: LoadedTour | None) -> EscapeRequest:
    """Make a request of a scenario, or of the ranges of the paper's Fig. 1.

    Parameters
    ----------
    loaded : LoadedTour or None
        The checked scenario.

    Returns
    -------
    EscapeRequest
    """
    if loaded is None:
        return EscapeRequest(WITHOUT_SCENARIO, EscapeSection(), "DE440")
    tour = loaded.scenario.tour
    return EscapeRequest(loaded.scenario.name, tour.escape, tour.ephemeris)


def run_escape(
    request: EscapeRequest, output: Path, options: RunOptions, say: Callable[[str], None] = lambda _: None
) -> Outcome:
    """Evaluate the maps, fly the two orbits, and store them.

    Parameters
    ----------
    request : EscapeRequest
        What was asked.
    output : Path
        Where the result goes.
    options : RunOptions
        Resume, force.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    Outcome
        The run as stored.

    Raises
    ------
    LandingError
        The output is refused.
    """
    watch = Stopwatch()
    text = f"name: {request.name}\nephemeris: {request.ephemeris}\n{section_to_yaml(request.section)}"
    identity = RunIdentity("tour escape", text, "", __version__, chunk_facets=1)
    journal = open_output(output, identity, resume=options.resume, force=options.force)
    if journal is None:
        return Outcome(run_from_result(read(output)), up_to_date=True, lost={})
    with journal:
        say("flying two orbits about the Earth")
        section = request.section
        maps = (
            _map("moon", GM_M3_S2["Moon"], MOON_RADIUS_M, section.moon, section.points),
            _map("earth", GM_M3_S2["Earth"], EARTH_RADIUS_M, section.earth, section.points),
        )
        found = EscapeRun(maps, fly_escapes(request.ephemeris))
        provenance = watch.provenance(resumed=int(options.resume))
        finish_output(journal, run_to_tree(found), {"mission": MISSION}, provenance, complete=True)
    return Outcome(found, up_to_date=False, lost={})


def _map(
    name: str, gm_m3_s2: float, radius_m: float, orbits: MoonOrbits | EarthOrbits, points: int
) -> EscapeMap:
    low, high = (
        1e3 * np.linspace(*altitudes, points)
        for altitudes in (orbits.periapsis_altitude_km, orbits.apoapsis_altitude_km)
    )
    increments = escape_increment(gm_m3_s2, radius_m, low[:, None], high[None])
    return EscapeMap(name, gm_m3_s2, radius_m, low, high, increments)

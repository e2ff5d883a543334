"""What a scenario asks of a dispersion, made absolute and held to body and spacecraft."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from landing_cli.reach.cases import landing_cases
from landing_cli.reach.records import LandingCase
from landing_cli.scenario.build import Built, Say, build
from landing_cli.scenario.load import LoadedScenario
from landing_cli.scenario.messages import Problem, refusal
from landing_cli.scenario.schema import Reach
from landing_cli.scenario.schema_disperse import LARGEST_RELATIVE, DisperseSection
from landing_cli.scenario.sections import disperse_section, fixed_stage_reach
from landing_cli.studies.disperse.axes import state_axes
from landing_cli.studies.disperse.records import Drawing, Spread

# No draw goes farther.
FARTHEST_SIGMAS = 8.3


@dataclass(frozen=True, eq=False)
class Request:
    """What a scenario asks of a dispersion.

    Attributes
    ----------
    loaded : LoadedScenario
    built : Built
    cases : tuple of (str, LandingCase)
        Those to disperse, each with the name of its initial state.
    drawing : Drawing
    """

    loaded: LoadedScenario
    built: Built
    cases: tuple[tuple[str, LandingCase], ...]
    drawing: Drawing


def request_of(loaded: LoadedScenario, built: Built | None = None, say: Say = lambda _: None) -> Request:
    """Make what a scenario asks for.

    Parameters
    ----------
    loaded : LoadedScenario
        The checked scenario.
    built : Built, optional
        What it describes, where that was built already.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    Request

    Raises
    ------
    InputRefused
        It lacks a section, or contradicts its mesh or itself.
    """
    reach, section = fixed_stage_reach(loaded, "reach disperse"), disperse_section(loaded)
    chosen = _chosen(loaded, reach, section)
    built = built or build(loaded, say)
    spread = spread_of(section, built, loaded)
    cases = tuple(
        (name, replace(case, margin=False))
        for name, case in landing_cases(reach, built)
        if case.name in chosen
    )
    for _, case in cases:
        state_axes(case, spread.axes)  # refused before anything is written
    return Request(loaded, built, cases, Drawing(section.seed, section.samples, section.confidence, spread))


def _chosen(loaded: LoadedScenario, reach: Reach, section: DisperseSection) -> list[str]:
    """Names of the cases to disperse."""
    names = [name for name, _, _ in reach.cases()]
    if section.cases is None:
        return names
    for index, name in enumerate(section.cases):
        if name not in names:
            problem = Problem(
                ("disperse", "cases", index), f"no case '{name}'", f"take one of {', '.join(names)}"
            )
            raise refusal([problem], loaded.places, loaded.source)
    return list(section.cases)


def spread_of(section: DisperseSection, built: Built, loaded: LoadedScenario) -> Spread:
    """Make the sigmas of a scenario absolute.

    Parameters
    ----------
    section : DisperseSection
        What it says.
    built : Built
        Mass, thrust and GM without deviation.
    loaded : LoadedScenario
        For messages.

    Returns
    -------
    Spread

    Raises
    ------
    InputRefused
        An absolute sigma is more than a tenth of its quantity, or the mass may fall to the propellant's.
    """
    craft = built.spacecraft
    mass = _absolute("mass_sigma_kg", section.mass_sigma_relative, craft.mass_kg, section, loaded)
    thrust = _absolute("thrust_sigma_n", section.thrust_sigma_relative, craft.thrust_max_n, section, loaded)
    gm = _absolute("gm_sigma_m3_s2", section.gm_sigma_relative, built.asteroid.gm_m3_s2, section, loaded)
    if craft.propellant_kg is not None and craft.mass_kg - FARTHEST_SIGMAS * mass <= craft.propellant_kg:
        key = "mass_sigma_kg" if section.mass_sigma_relative is None else "mass_sigma_relative"
        told = f"draws of {FARTHEST_SIGMAS:g} sigma leave less mass than spacecraft.propellant_kg"
        raise _refused(loaded, key, told, "the propellant on board is not dispersed: lower the sigma")
    return Spread(section.axes, np.array(section.state_factor()), mass, thrust, gm)


def _absolute(
    key: str, relative: float | None, nominal: float, section: DisperseSection, loaded: LoadedScenario
) -> float:
    if relative is not None:
        return relative * nominal
    sigma = float(getattr(section, key) or 0.0)
    if sigma > LARGEST_RELATIVE * nominal:
        told = f"{sigma:g} is more than a tenth of {nominal:g}"
        raise _refused(loaded, key, told, "check the unit: a normal that wide draws negative ones")
    return sigma


def _refused(loaded: LoadedScenario, key: str, what: str, fix: str) -> Exception:
    return refusal([Problem(("disperse", key), what, fix)], loaded.places, loaded.source)

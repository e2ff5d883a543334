"""The section of a scenario that a command asks for."""

from __future__ import annotations

from landing_cli.errors import InputRefused
from landing_cli.scenario.load import LoadedScenario
from landing_cli.scenario.messages import Problem, refusal
from landing_cli.scenario.schema import Reach, Scenario
from landing_cli.scenario.schema_disperse import DisperseSection
from landing_cli.scenario.schema_isochrone import IsochroneSection
from landing_cli.scenario.schema_observe import ObserveSection
from landing_cli.scenario.schema_plan import PlanSection

MISSIONS = (
    "reach",
    "plan",
    "observe",
    "isochrone",
    "disperse",
)


def reach_section(loaded: LoadedScenario) -> Reach:
    """Return what a scenario says for ``reach``.

    Parameters
    ----------
    loaded : LoadedScenario
        The checked scenario.

    Returns
    -------
    Reach

    Raises
    ------
    InputRefused
        It has no such section.
    """
    if loaded.scenario.reach is None:
        raise _missing(loaded, "reach", "`reach run` needs initial_states, tof_s and final_stage_s there")
    return loaded.scenario.reach


def plan_section(loaded: LoadedScenario) -> PlanSection:
    """Return what a scenario says for ``plan``.

    Parameters
    ----------
    loaded : LoadedScenario
        The checked scenario.

    Returns
    -------
    PlanSection

    Raises
    ------
    InputRefused
        It has no such section.
    """
    if loaded.scenario.plan is None:
        raise _missing(loaded, "plan", "`plan` needs initial_state, site and tof_s there")
    return loaded.scenario.plan


def observe_section(loaded: LoadedScenario) -> ObserveSection:
    """Return what a scenario says for ``plan observe``.

    Parameters
    ----------
    loaded : LoadedScenario
        The checked scenario.

    Returns
    -------
    ObserveSection

    Raises
    ------
    InputRefused
        It has no such section.
    """
    if loaded.scenario.observe is None:
        fix = "`plan observe` needs initial_state, site, tof_s, landmarks, sensor and prior there"
        raise _missing(loaded, "observe", fix)
    return loaded.scenario.observe


def isochrone_section(loaded: LoadedScenario) -> IsochroneSection:
    """Return what a scenario says for ``reach isochrone``; the defaults where it says nothing."""
    return loaded.scenario.isochrone or IsochroneSection()


def disperse_section(loaded: LoadedScenario) -> DisperseSection:
    """Return what a scenario says for ``reach disperse``.

    Parameters
    ----------
    loaded : LoadedScenario
        The checked scenario.

    Returns
    -------
    DisperseSection

    Raises
    ------
    InputRefused
        It has no such section, or that one disperses nothing.
    """
    fix = "`reach disperse` needs position_sigma_m, velocity_sigma_m_s, thrust_sigma_relative, ... there"
    if loaded.scenario.disperse is None:
        raise _missing(loaded, "disperse", fix)
    if not loaded.scenario.disperse.disperses:
        raise refusal([Problem(("disperse",), "disperses nothing", fix)], loaded.places, loaded.source)
    return loaded.scenario.disperse


def fixed_stage_reach(loaded: LoadedScenario, study: str) -> Reach:
    """Return the section ``reach`` for a study that takes one duration of the final stage for all facets.

    Parameters
    ----------
    loaded : LoadedScenario
        The checked scenario.
    study : str
        The command; for the message.

    Returns
    -------
    Reach

    Raises
    ------
    InputRefused
        It has no such section, or its final stage is free.
    """
    reach = reach_section(loaded)
    if not isinstance(reach.final_stage_s, float):
        fix = f"give it a number: --set reach.final_stage_s={reach.final_stage_compared_s or 200:g}"
        problem = Problem(("reach", "final_stage_s"), f"is free, and `{study}` takes one duration", fix)
        raise refusal([problem], loaded.places, loaded.source)
    return reach


def for_mission(scenario: Scenario, *missions: str) -> Scenario:
    """Drop the sections of other missions: what they say changes no number of this one.

    Parameters
    ----------
    scenario : Scenario
        All of it.
    *missions : {"reach", "plan", "observe", "isochrone", "disperse"}
        Whose sections stay.

    Returns
    -------
    Scenario
    """
    return scenario.model_copy(update={name: None for name in MISSIONS if name not in missions})


def _missing(loaded: LoadedScenario, name: str, fix: str) -> InputRefused:
    problem = Problem((name,), "the scenario has no such section", fix)
    return refusal([problem], {}, loaded.source)

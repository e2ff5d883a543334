"""The tasks of each plan command, from the scenario's plan section."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from landing_cli.plan.cases import plan_cases
from landing_cli.plan.initial_states import even_longitudes, turned_cases
from landing_cli.plan.pipeline import Request
from landing_cli.plan.records import (
    BezierOptions,
    ConvexOptions,
    FreeGuidesOptions,
    PlanCase,
    PseudospectralOptions,
)
from landing_cli.plan.tasks import PlanTask
from landing_cli.scenario.schema_plan import PlanSection
from landing_cli.scenario.sections import plan_section


def bezier_tasks(request: Request, shortest: bool) -> tuple[PlanTask, ...]:
    """Guide points searched for every time of flight, or the shortest time.

    Parameters
    ----------
    request : Request
        What was asked.
    shortest : bool
        Search the time too, beginning with the scenario's first.

    Returns
    -------
    tuple of PlanTask
    """
    section, cases = _asked(request)
    options = _bezier(section)
    if shortest:
        return (PlanTask("bezier_shortest", "shortest_time", cases[0], options),)
    return tuple(PlanTask(f"bezier_{case.name}", "bezier", case, options) for case in cases)


def convex_tasks(request: Request, degrees: Sequence[int]) -> tuple[PlanTask, ...]:
    """Free control for every time of flight, or Bezier curves of some degrees with free guide points.

    Parameters
    ----------
    request : Request
        What was asked.
    degrees : sequence of int
        Of the curves; empty for free control.

    Returns
    -------
    tuple of PlanTask
    """
    section, cases = _asked(request)
    if not degrees:
        return tuple(_convex(section, case) for case in cases)
    return tuple(_free_guides(section, case, degree) for case in cases for degree in degrees)


def pseudospectral_tasks(request: Request) -> tuple[PlanTask, ...]:
    """The pseudospectral transcription for every time of flight.

    Parameters
    ----------
    request : Request
        What was asked.

    Returns
    -------
    tuple of PlanTask
    """
    section, cases = _asked(request)
    return tuple(_pseudospectral(section, case) for case in cases)


def compare_tasks(request: Request) -> tuple[PlanTask, ...]:
    """Every method on every case (Lyu 2026, Table 2), and the free control with eq 4's conditions.

    Parameters
    ----------
    request : Request
        What was asked.

    Returns
    -------
    tuple of PlanTask
    """
    section, cases = _asked(request)
    return tuple(
        task
        for case in cases
        for task in (
            _pseudospectral(section, case),
            PlanTask(f"bezier_{case.name}", "bezier", case, _bezier(section)),
            _free_guides(section, case, section.free_guides.degree),
            _convex(section, case),
            _convex_as_paper(section, case),
        )
    )


def sweep_tasks(request: Request) -> tuple[PlanTask, ...]:
    """Guide points searched from initial states all round the body (Lyu 2026, section 3.3).

    Parameters
    ----------
    request : Request
        What was asked.

    Returns
    -------
    tuple of PlanTask
        For every longitude and time of flight.
    """
    section, cases = _asked(request)
    options = _bezier(section)
    given = section.sweep.longitudes_deg
    longitudes = even_longitudes(section.sweep.longitudes).tolist() if given is None else list(given)
    return tuple(
        PlanTask(turned.name, "bezier", turned, options, {"longitude_deg": longitude}, reflight=True)
        for case in cases
        for longitude, turned in zip(longitudes, turned_cases(case, longitudes), strict=True)
    )


def _asked(request: Request) -> tuple[PlanSection, tuple[PlanCase, ...]]:
    cases = plan_cases(request.loaded, request.asteroid, request.spacecraft)
    return plan_section(request.loaded), cases


def _bezier(section: PlanSection) -> BezierOptions:
    return BezierOptions(**section.bezier.model_dump())


def _free_guides(section: PlanSection, case: PlanCase, degree: int) -> PlanTask:
    options = FreeGuidesOptions(**{**section.free_guides.model_dump(), "degree": degree})
    return PlanTask(f"bezier_degree{degree}_{case.name}", "bezier_free_guides", case, options)


def _convex(section: PlanSection, case: PlanCase) -> PlanTask:
    return PlanTask(f"convex_{case.name}", "convex", case, ConvexOptions(**section.convex.model_dump()))


def _convex_as_paper(section: PlanSection, case: PlanCase) -> PlanTask:
    options = replace(ConvexOptions(**section.convex.model_dump()), terminal="paper")
    return PlanTask(f"convex_paper_{case.name}", "convex", case, options)


def _pseudospectral(section: PlanSection, case: PlanCase) -> PlanTask:
    options = PseudospectralOptions(**section.pseudospectral.model_dump())
    return PlanTask(f"pseudospectral_{case.name}", "pseudospectral", case, options)

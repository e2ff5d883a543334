"""What is stored of a facet, turned into the flight it stands for."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityField
from landing_cli.errors import InputRefused
from landing_cli.flight.legs import CostateLeg, FinalArcLeg, Leg, ThrustNodesLeg
from landing_cli.flight.replay import replay
from landing_cli.flight.trajectory import Trajectory
from landing_cli.reach.records import FacetSolutions, LandingCase, Verdict
from landing_cli.reach.stored import CaseResult


def rows_with_flight(solutions: FacetSolutions) -> NDArray[np.bool_]:
    """Which rows store a flight that can be flown again, (n,) bool."""
    rows = solutions.rows
    controlled = (rows["thrust_nodes"] > 0) | np.isfinite(rows["costates"]).all(axis=1)
    handed_over = np.isfinite(rows["handover_position_m"]) & np.isfinite(rows["handover_velocity_m_s"])
    return np.asarray(controlled & handed_over.all(axis=1))


def asked_row(result: CaseResult, facet: int) -> int:
    """Find the row of a facet.

    Parameters
    ----------
    result : CaseResult
        The case.
    facet : int
        0-based.

    Raises
    ------
    InputRefused
        If there is no such facet, or it was not solved.
    """
    case, facets = result.case, result.solutions.rows["facet"]
    where, count = f"--facet {facet}", len(case.asteroid.mesh.faces)
    if not 0 <= facet < count:
        raise InputRefused("no such facet", where=where, fix=f"take one of 0 to {count - 1}")
    row = int(np.searchsorted(facets, facet))
    if row == len(facets) or facets[row] != facet:
        fix = "run with --set reach.method=traverse, or take another facet"
        raise InputRefused(f"{case.name} never asked for this facet", where=where, fix=fix)
    return row


def row_of(result: CaseResult, facet: int) -> int:
    """Find the row that stores a facet's flight.

    Parameters
    ----------
    result : CaseResult
        The case.
    facet : int
        0-based.

    Raises
    ------
    InputRefused
        If there is no such facet, it was not solved, or no flight to it was found; says why.
    """
    row = asked_row(result, facet)
    if not rows_with_flight(result.solutions)[row]:
        known = result.solutions.rows[row]
        told = f"no flight to it in {result.case.name}: it is {Verdict(int(known['verdict'])).name.lower()}"
        if facet in result.lost:
            told += f", lost because {result.lost[facet]}"
        elif np.isfinite(known["violation"]):
            told += f", and the best attempt breaks a constraint by {known['violation']:.3g} of its scale"
        raise InputRefused(told, where=f"--facet {facet}", fix="take a facet whose verdict is reachable")
    return row


def case_of_row(case: LandingCase, solutions: FacetSolutions, row: int) -> LandingCase:
    """Return the case as it was flown to the facet of a row, with its own duration of the final stage."""
    if case.free_final_stage is None:
        return case
    return case.with_final_stage(float(solutions.rows["final_stage_s"][row]))


def flown_legs(case: LandingCase, solutions: FacetSolutions, row: int) -> tuple[Leg, Leg]:
    """Return the stored control of a row: descent stage and final landing stage.

    Parameters
    ----------
    case : LandingCase
        What was asked.
    solutions : FacetSolutions
        Its answers.
    row : int
        A row with a flight, see :func:`rows_with_flight`.

    Returns
    -------
    descent, final : Leg
        Thrust nodes where there are any, else costates; then the arc from the handover to the centroid.
    """
    case, known = case_of_row(case, solutions, row), solutions.rows[row]
    gravity = case.asteroid.gravity
    descent: Leg
    if known["thrust_nodes"] > 0:
        descent = ThrustNodesLeg(case.descent_s, solutions.nodes_of(row))
    else:
        descent = CostateLeg(
            case.descent_s,
            known["costates"].copy(),
            case.position_m,
            case.velocity_m_s,
            case.spacecraft.mass_kg,
            case.spacecraft.thrust_max_n,
            gravity,
        )
    mesh = case.asteroid.mesh
    target = mesh.vertices[mesh.faces[known["facet"]]].mean(axis=0)
    handover = known["handover_position_m"].copy(), known["handover_velocity_m_s"].copy()
    return descent, FinalArcLeg(case.final_stage_s, *handover, target, gravity)


def flown_trajectory(
    result: CaseResult,
    facet: int,
    *,
    field: GravityField | None = None,
    integrator: Literal["dop853", "gauss"] = "dop853",
) -> Trajectory:
    """Fly the stored control to a facet again, open loop.

    Parameters
    ----------
    result : CaseResult
        The case.
    facet : int
        0-based; must have a flight.
    field : GravityField, optional
        The field to fly in; the asteroid's own unless given.
    integrator : {"dop853", "gauss"}
        See :func:`landing_cli.flight.replay.replay`.

    Returns
    -------
    Trajectory
        From the initial state to touchdown.

    Raises
    ------
    InputRefused
        If the facet has no flight.
    """
    case = result.case
    return replay(
        case.position_m,
        case.velocity_m_s,
        case.spacecraft.mass_kg,
        flown_legs(case, result.solutions, row_of(result, facet)),
        rotation_rate_rad_s=case.asteroid.rotation_rate_rad_s,
        field=case.asteroid.gravity if field is None else field,
        exhaust_velocity_m_s=case.spacecraft.exhaust_velocity_m_s,
        integrator=integrator,
    )

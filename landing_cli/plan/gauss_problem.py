"""A landing in one or two phases as polynomials at Gauss points: the problem, and how its unknowns fly."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.legs import AccelerationLeg, GaussAccelerationLeg
from landing_cli.optimize.collocation import gauss_span
from landing_cli.plan.gauss_phases import Phase, PhaseFlight, fly_phase
from landing_cli.plan.records import CHECK_SAMPLES, Objective, PlanCase, TerminalConditions

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GaussProblem:
    """A case with its phases and the grids on which it is bound.

    Attributes
    ----------
    case : PlanCase
    objective : {"fuel", "energy"}
    terminal : {"rest", "paper"}
    entry : int
        The sample, of `CHECK_SAMPLES`, at which the second phase and the cone begin.
    phases : tuple of Phase
        Up to the cone entry, and after it.
    thrust_share : tuple of float
        Share of the greatest thrust that each phase may use at the points of the finer rule.
    drift : (6,) float, m, m/s
        By how much an integrator flies past the end of the first phase's polynomials: the second phase has
        to begin there.
    margin_m : float, m
        Added to the clearance.
    """

    case: PlanCase
    objective: Objective
    terminal: TerminalConditions
    entry: int
    phases: tuple[Phase, ...]
    thrust_share: tuple[float, ...]
    drift: FloatArray = field(default_factory=lambda: np.zeros(6))
    margin_m: float = 0.01  # more than the solver's tolerances leave

    @property
    def scale_m_s2(self) -> float:
        """Greatest thrust acceleration on the initial mass, m/s2."""
        return self.case.spacecraft.thrust_max_n / self.case.spacecraft.mass_kg

    @property
    def node_counts(self) -> tuple[int, ...]:
        """Nodes of each phase."""
        return tuple(len(phase.span.nodes) for phase in self.phases)

    @property
    def node_times_s(self) -> FloatArray:
        """Times of all nodes, (n,) s."""
        return np.concatenate([phase.times_of(phase.span.nodes) for phase in self.phases])

    @property
    def control_size(self) -> int:
        """Unknowns that are control, and as many that are position."""
        return 3 * sum(self.node_counts)

    def controls(self, x: FloatArray) -> list[FloatArray]:
        """Return the scaled control at the nodes of each phase, (n, 3) each."""
        edges = 3 * np.cumsum([0, *self.node_counts])
        return [x[a:b].reshape(-1, 3) for a, b in pairwise(edges)]

    def legs(self, x: FloatArray) -> tuple[AccelerationLeg, ...]:
        """Return the control as legs that can be flown again."""
        return tuple(
            GaussAccelerationLeg(np.array([0.0, phase.end_s - phase.start_s]), self.scale_m_s2 * u[None])
            for phase, u in zip(self.phases, self.controls(x), strict=True)
        )


def gauss_problem(
    case: PlanCase,
    objective: Objective,
    terminal: TerminalConditions,
    entry: int,
    nodes: tuple[int, ...],
    thrust_share: tuple[float, ...] = (1.0, 1.0),
) -> GaussProblem:
    """Lay the phases out.

    Parameters
    ----------
    case : PlanCase
        What is asked.
    objective : {"fuel", "energy"}
        The integral of |u|, or of its square.
    terminal : {"rest", "paper"}
        Whether Lyu 2026's terminal acceleration and angle (eq 4) are imposed.
    entry : int
        First sample, of `CHECK_SAMPLES`, of the phase inside the cone; 0 for one phase without path bounds.
    nodes : tuple of int
        Legendre-Gauss nodes of each phase.
    thrust_share : tuple of float
        Share of the greatest thrust that each phase may use.

    Returns
    -------
    GaussProblem
    """
    edges = [0.0, case.tof_s]
    if entry:
        edges.insert(1, case.tof_s * entry / (CHECK_SAMPLES - 1))
    spans = [gauss_span(n) for n in nodes]
    phases = tuple(Phase(*parts) for parts in zip(spans, edges[:-1], edges[1:], strict=True))
    return GaussProblem(case, objective, terminal, entry, phases, thrust_share[: len(phases)])


def phase_flights(problem: GaussProblem, x: FloatArray) -> list[PhaseFlight]:
    """Fly the first phase from the start and the second one back from the site.

    Parameters
    ----------
    problem : GaussProblem
        The problem.
    x : (2 q + m,) float
        Scaled unknowns.

    Returns
    -------
    list of PhaseFlight
        One for each phase.
    """
    case = problem.case
    gravity, w = case.asteroid.gravity, case.asteroid.rotation_rate_rad_s
    start = np.concatenate([case.position_m, case.velocity_m_s])
    end = np.concatenate([case.site.position_m, case.landing_velocity_m_s])
    controls = [problem.scale_m_s2 * u for u in problem.controls(x)]
    flights = [fly_phase(gravity, w, problem.phases[0], start, controls[0])]
    if problem.entry:
        flights.append(fly_phase(gravity, w, problem.phases[1], end, controls[1], backwards=True))
    return flights

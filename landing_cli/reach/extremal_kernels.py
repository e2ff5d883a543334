"""The first compilation of the kernels of extremals, in parts (see `kernels`)."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from landing_cli.optimize.sqp import propose
from landing_cli.reach.costate_dynamics import fly_extremal
from landing_cli.reach.delivery import measure_of, new_deliveries
from landing_cli.reach.extremal_delivery import fill_deliveries
from landing_cli.reach.extremal_facet import new_flight, renew_model, try_costates
from landing_cli.reach.extremal_search import Searcher, new_found, new_searcher, search_batch
from landing_cli.reach.extremal_terms import ExtremalProblem, extremal_problem
from landing_cli.reach.free_descent import PreparedCase

_typeof: Any = numba.typeof

KERNELS: tuple[Any, ...] = (search_batch, renew_model, try_costates, propose, fly_extremal, fill_deliveries)


def _searcher(prepared: PreparedCase) -> tuple[ExtremalProblem, Searcher]:
    problem = extremal_problem(prepared.case)
    return problem, new_searcher(problem, 1)


def _extremal_model(prepared: PreparedCase) -> None:
    """Tangents of an extremal, and the Hessian."""
    _searcher(prepared)[1].renew_model.compile()


def _extremal_trial(prepared: PreparedCase) -> None:
    """Cost and rows of an extremal."""
    _searcher(prepared)[1].try_costates.compile()


def _extremal_program(prepared: PreparedCase) -> None:
    """The quadratic program of a round."""
    _searcher(prepared)[1].propose.compile()


def _extremal_flight(prepared: PreparedCase) -> None:
    """The flight of an extremal."""
    _searcher(prepared)[1].here.fly.compile()


def _extremal_search(prepared: PreparedCase) -> None:
    """The loop over facets and rounds."""
    problem, searcher = _searcher(prepared)
    one = np.ones((1, 3))
    arguments = problem, one, one, np.ones((1, 1, 7)), np.zeros(1), searcher, new_found(1)
    search_batch.compile(tuple(_typeof(argument) for argument in arguments))


def _extremal_delivery(prepared: PreparedCase) -> None:
    """The accurate flight of an extremal and its measures."""
    problem, _ = _searcher(prepared)
    frame, surface, one = prepared.frame, prepared.shared.surface, np.ones((1, 3))
    measure = measure_of(frame, surface, problem.field.kind, problem.field.params)
    flight = new_flight(problem.field, 1)
    work = flight, np.empty((1, 3)), measure, new_deliveries(1)
    arguments = problem, frame, surface, np.zeros((1, 7)), one, one, *work
    fill_deliveries.compile(tuple(_typeof(argument) for argument in arguments))


# the longest first
PARTS = (
    _extremal_model,
    _extremal_search,
    _extremal_trial,
    _extremal_program,
    _extremal_delivery,
    _extremal_flight,
)

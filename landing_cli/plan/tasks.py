"""What a plan command computes: tasks of one method on one case, solved in any order and place."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from landing_cli.plan.records import (
    BezierOptions,
    ConvexOptions,
    FreeGuidesOptions,
    Parameter,
    Plan,
    PlanCase,
    PseudospectralOptions,
)
from landing_cli.plan.stored import PlanEntry
from landing_cli.plan.verify import verify_entry

MethodOptions = BezierOptions | FreeGuidesOptions | ConvexOptions | PseudospectralOptions

WORTH_REPEATING_S = 30.0
"""A first solve that took less is repeated: it holds the compilation or loading of kernels too."""


@dataclass(frozen=True, eq=False)
class PlanTask:
    """One method on one case.

    Attributes
    ----------
    name : str
        Of the task in tables and files: ``bezier_2000s``.
    method : {"bezier", "shortest_time", "bezier_free_guides", "convex", "pseudospectral"}
    case : PlanCase
    options : BezierOptions, FreeGuidesOptions, ConvexOptions or PseudospectralOptions
    parameters : mapping
        What belongs to the task beside the method's own choices, such as the longitude of a sweep.
    reflight : bool
        Whether an accepted plan is flown again at once.
    """

    name: str
    method: str
    case: PlanCase
    options: MethodOptions
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    reflight: bool = False


@dataclass(frozen=True, eq=False)
class SolvedTask:
    """A task's answer.

    Attributes
    ----------
    index : int
        Of the task.
    plan : Plan
    cpu_s : float
        CPU time of one solve, compiled kernels loaded.
    """

    index: int
    plan: Plan
    cpu_s: float


def solve_tasks(tasks: Sequence[PlanTask], indices: Sequence[int], repeat: bool = True) -> list[SolvedTask]:
    """Solve some tasks.

    Parameters
    ----------
    tasks : sequence of PlanTask
        All of them.
    indices : sequence of int
        Which to solve.
    repeat : bool
        Whether a quick first solve is repeated for its time.

    Returns
    -------
    list of SolvedTask
    """
    return [_timed(index, tasks[index], repeat) for index in indices]


def _timed(index: int, task: PlanTask, repeat: bool) -> SolvedTask:
    began = time.thread_time()
    plan = solve_task(task)
    cpu_s = time.thread_time() - began
    if repeat and cpu_s < WORTH_REPEATING_S:
        began = time.thread_time()
        plan = solve_task(task)
        cpu_s = time.thread_time() - began
    return SolvedTask(index, _flown_again(task, plan), cpu_s)


def solve_task(task: PlanTask) -> Plan:
    """Plan by the task's method.

    Parameters
    ----------
    task : PlanTask
        What to solve.

    Returns
    -------
    Plan
        With the task's own parameters beside the method's.
    """
    plan = _method(task.method)(task.case, task.options)
    return replace(plan, parameters={**task.parameters, **plan.parameters})


def _flown_again(task: PlanTask, plan: Plan) -> Plan:
    """Add to an accepted plan what an integrator that did not plan it says: ``verified``, or why not."""
    if not task.reflight or plan.status != "planned":
        return plan
    case = replace(task.case, tof_s=plan.tof_s)
    report = verify_entry(PlanEntry(task.name, case, plan, math.nan), integrator="gauss")
    return replace(plan, parameters={**plan.parameters, "reflight": report.reason or "verified"})


def _method(name: str) -> Callable[[PlanCase, Any], Plan]:
    """Load a method; each brings its own libraries."""
    if name == "bezier":
        from landing_cli.plan.bezier import plan_bezier

        return plan_bezier
    if name == "shortest_time":
        from landing_cli.plan.shortest_time import plan_shortest_time

        return plan_shortest_time
    if name == "bezier_free_guides":
        from landing_cli.plan.bezier_free_guides import plan_bezier_free_guides

        return plan_bezier_free_guides
    if name == "convex":
        from landing_cli.plan.convex import plan_convex

        return plan_convex
    from landing_cli.plan.pseudospectral import plan_pseudospectral

    return plan_pseudospectral

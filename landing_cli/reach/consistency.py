"""Whether the rows of a case agree with themselves, with each other, and with the case's summary."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.boundary_lines import lines_from_group, margin_lines
from landing_cli.reach.flown import rows_with_flight
from landing_cli.reach.free_descent import PATH_COLUMNS
from landing_cli.reach.records import Binding, Verdict
from landing_cli.reach.stored import CaseResult
from landing_cli.reach.summary import has_margin, summarise

Flags = NDArray[np.bool_]

# Levels are searched to this; a certificate is exact.
LEVEL_SLACK = 1e-4
# Lines that are traced again may differ by rounding, m.
LINES_APART_M = 1e-6


@dataclass(frozen=True)
class Fault:
    """Something in a stored case that cannot be true.

    Attributes
    ----------
    told : str
        What it is, as ``facet 17 is reachable, but its violation is not 0``.
    facet : int or None
        Where, if it is about one facet.
    """

    told: str
    facet: int | None = None


def faults_of(result: CaseResult) -> tuple[Fault, ...]:
    """Look for what cannot be true in a case.

    Parameters
    ----------
    result : CaseResult
        The case as stored.

    Returns
    -------
    tuple of Fault
        Empty where all is consistent.
    """
    facets = result.solutions.rows["facet"]
    found = list(_faults_of_list(result))
    for wrong, told in _rules(result):
        found += [Fault(f"facet {facet} {told}", facet) for facet in facets[wrong].tolist()]
    return (*found, *_faults_of_summary(result))


def _faults_of_list(result: CaseResult) -> Iterator[Fault]:
    """Every facet is listed once, in order; all of them unless only a section or a trace was asked."""
    facets, count = result.solutions.rows["facet"], len(result.case.asteroid.mesh.faces)
    again = facets[1:][np.diff(facets) <= 0]
    for facet in again.tolist():
        yield Fault(f"facet {facet} stands in the table twice, or out of order", facet)
    for facet in facets[(facets < 0) | (facets >= count)].tolist():
        yield Fault(f"facet {facet} does not exist", facet)
    partial = [result.summary.get(method) for method in ("section", "trace")]
    traversed = all(not isinstance(part, dict) or part.get("iou") is not None for part in partial)
    missing = np.setdiff1d(np.arange(count), facets)
    if traversed and len(missing):
        yield Fault(f"{len(missing)} facets are missing from the table, the first is {missing[0]}")


def _rules(result: CaseResult) -> Iterator[tuple[Flags, str]]:
    """What no row may be: where it is broken, and how to say it."""
    rows = result.solutions.rows
    reachable, unreachable = rows["verdict"] == Verdict.REACHABLE, rows["verdict"] == Verdict.UNREACHABLE
    yield ~np.isin(rows["verdict"], list(Verdict)), "has a verdict of no meaning"
    yield ~np.isin(rows["binding"], list(Binding)), "has a binding constraint of no meaning"
    yield (rows["proved"] != 0) & ~unreachable, "is proved unreachable, but its verdict is another"
    yield reachable & (rows["violation"] != 0.0), "is reachable, but its violation is not 0"
    yield unreachable & ~(rows["violation"] > 0.0), "is unreachable, but its violation is not above 0"
    yield reachable & (rows["thrust_margin"] < 0.0), "is reachable, but needs more than all thrust"
    yield reachable & ~rows_with_flight(result.solutions), "is reachable, but its control is missing"
    yield ~reachable & (rows["thrust_nodes"] > 0), "is not reachable, but has thrust nodes"
    level, bound = 1.0 - rows["thrust_margin"], rows["thrust_level_bound"]
    slack = 1.0 + LEVEL_SLACK
    yield bound > level * slack, "has a least thrust level below its certified bound"
    yield bound > rows["thrust_level_flown"] * slack, "has a flight below its certified thrust level"
    yield reachable & (bound > 1.0), "is reachable, but its certified bound is above full thrust"
    yield (rows["proved"] != 0) & (bound < 1.0), "is proved unreachable, but its bound is below full thrust"
    if result.case.margin and result.case.descent == "free":
        within = unreachable & (rows["binding"] != Binding.TERRAIN) & (level <= 1.0)
        yield within, "is unreachable, but full thrust is enough"
    for name in PATH_COLUMNS:
        blank = np.isnan(rows[name]).reshape(len(rows), -1)
        yield reachable & blank.any(axis=1), f"is reachable, but its {name} is missing"
        yield ~reachable & ~blank.all(axis=1), f"is not reachable, but has a {name}"
    lost = np.isin(rows["facet"], list(result.lost))
    yield lost & (rows["verdict"] != Verdict.UNRESOLVED), "was lost, but has a verdict"


def _faults_of_summary(result: CaseResult) -> Iterator[Fault]:
    """The summary says what the rows say."""
    rows, count = result.solutions.rows, len(result.case.asteroid.mesh.faces)
    if ((rows["facet"] < 0) | (rows["facet"] >= count)).any():
        return
    for name, value in summarise(result.case.asteroid.mesh, result.solutions).items():
        told = result.summary.get(name)
        if not _same(told, value):
            yield Fault(f"the summary says {name} {told}, the table {value}")
    yield from _faults_of_lines(result)


def _faults_of_lines(result: CaseResult) -> Iterator[Fault]:
    """The boundary's lines are those of the table's margins."""
    rows, mesh = result.solutions.rows, result.case.asteroid.mesh
    expected = result.case.margin and has_margin(rows) and len(rows) == len(mesh.faces)
    if expected != (result.level_set is not None):
        yield Fault("the boundary's lines are missing" if expected else "there are lines of a boundary")
    elif result.level_set is not None:
        stored, traced = lines_from_group(result.level_set), margin_lines(mesh, rows)
        alike = stored.points_m.shape == traced.points_m.shape
        alike = alike and np.array_equal(stored.offsets, traced.offsets)
        if not alike or not np.allclose(stored.points_m, traced.points_m, rtol=0.0, atol=LINES_APART_M):
            yield Fault("the boundary's lines are not those of the margins")


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_same(a[key], b[key]) for key in a)
    if isinstance(a, float) and isinstance(b, float):
        return math.isclose(a, b, rel_tol=1e-12)
    return bool(a == b)

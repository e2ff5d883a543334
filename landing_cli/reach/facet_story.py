"""What is known about one facet, in a sentence and as a table."""

from __future__ import annotations

from typing import Any

import numpy as np

from landing_cli.reach.flown import asked_row
from landing_cli.reach.records import FACET_COLUMNS, Binding, Verdict
from landing_cli.reach.stored import CaseResult

Row = Any  # one row of FACET_DTYPE

_WORDS = {
    Binding.NONE: "nothing",
    Binding.THRUST: "the thrust",
    Binding.ELLIPSOID: "the ellipsoid",
    Binding.GLIDE_SLOPE: "the glide slope",
    Binding.PROPELLANT: "the propellant",
    Binding.TERRAIN: "the terrain",
    Binding.HANDOVER: "the handover",
}


_AROUND = {
    Binding.ELLIPSOID: " to pass around the ellipsoid",
    Binding.GLIDE_SLOPE: " to stay inside the glide slope",
    Binding.TERRAIN: " to pass clear of the rock, on the best way that was found",
}


def tell_facet(result: CaseResult, facet: int) -> str:
    """Say in one sentence what is known about a facet, and why.

    Parameters
    ----------
    result : CaseResult
        The case.
    facet : int
        0-based.

    Raises
    ------
    InputRefused
        If there is no such facet, or the run did not ask for it.
    """
    row = result.solutions.rows[asked_row(result, facet)]
    verdict, told = Verdict(int(row["verdict"])), f"facet {facet} is"
    if verdict is Verdict.REACHABLE:
        return f"{told} reachable: {_flight(row)}"
    if verdict is Verdict.UNREACHABLE:
        return f"{told} unreachable ({'proved' if row['proved'] else 'not proved'}): {_obstacle(result, row)}"
    if facet in result.lost:
        return f"{told} unresolved: it was lost, {result.lost[facet]}"
    if Binding(int(row["binding"])) is Binding.TERRAIN:
        return f"{told} unresolved: no flight clear of rock was found, the best cuts {_depth(result, row)}"
    if Binding(int(row["binding"])) is Binding.PROPELLANT:
        burnt = (result.case.spacecraft.propellant_kg or 0.0) * (1.0 + float(row["violation"]))
        return f"{told} unresolved: no flight within the propellant was found, the best burns {burnt:.4g} kg"
    return f"{told} unresolved: no search converged{_attempt(row)}"


def facet_facts(result: CaseResult, facet: int) -> dict[str, Any]:
    """Every stored column of a facet by name, enumerations in words, vectors as lists.

    Parameters
    ----------
    result : CaseResult
        The case.
    facet : int
        0-based.
    """
    row = result.solutions.rows[asked_row(result, facet)]
    facts = {}
    for column in FACET_COLUMNS:
        value = row[column.name].tolist()
        facts[column.name] = value if column.flags is None else column.flags(value).name.lower()
    return facts


def _flight(row: Row) -> str:
    parts = [
        f"{row['delta_v_m_s']:.4g} m/s, {row['fuel_kg']:.4g} kg",
        f"peak thrust {100.0 * row['peak_thrust_ratio']:.4g} %",
    ]
    if np.isfinite(row["thrust_margin"]):
        parts.append(f"least level that reaches it {_percent(1.0 - row['thrust_margin'])}")
    depth_m = -row["terrain_clearance_min_m"]
    if depth_m > 0.0:
        parts.append(f"but the path cuts {depth_m:.3g} m into rock")
    return f"{', '.join(parts)}; what binds: {_WORDS[Binding(int(row['binding']))]}"


def _obstacle(result: CaseResult, row: Row) -> str:
    binding, violation = Binding(int(row["binding"])), float(row["violation"])
    if binding is Binding.TERRAIN and result.case.descent == "extremal":
        return "every extremal that was found cuts rock on the way"
    if result.case.descent == "extremal" and not row["proved"]:
        return f"no extremal meets every limit{_attempt(row)}; what stops it: {_WORDS[binding]}"
    around = _AROUND.get(binding, "")
    if binding is Binding.TERRAIN:  # the least thrust level of a facet knows nothing of rock
        return f"it needs {_percent(1.0 + violation)} of the thrust{around}"
    if np.isfinite(row["thrust_margin"]):
        bound = row["thrust_level_bound"]
        certified = f" (certified: at least {_percent(bound)})" if bound > 1.0 else ""
        return f"it needs {_percent(1.0 - row['thrust_margin'])} of the thrust{around}{certified}"
    return f"it needs at least {_percent(1.0 + violation)} of the thrust{around}"


def _percent(share: float) -> str:
    return f"{100.0 * share:.4g} %"


def _depth(result: CaseResult, row: Row) -> str:
    """How deep in rock the best flight is; the violation is in units of a0 tp^2."""
    case = result.case
    scale_m = case.spacecraft.thrust_max_n / case.spacecraft.mass_kg * case.descent_s**2
    return f"{float(row['violation']) * scale_m:.3g} m into it"


def _attempt(row: Row) -> str:
    violation = float(row["violation"])
    return f", the best attempt breaks a limit by {violation:.3g} of its scale" if violation > 0.0 else ""

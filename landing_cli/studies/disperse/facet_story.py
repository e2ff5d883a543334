"""How surely one facet is reachable, in a sentence and as a table."""

from __future__ import annotations

from typing import Any

import numpy as np

from landing_cli.errors import InputRefused
from landing_cli.studies.disperse.draws import deviations, standard_normals
from landing_cli.studies.disperse.records import CaseDispersion, Driver, FloatArray, drivers_of
from landing_cli.studies.disperse.statistics import verdict_correlations

# A rank correlation within this many of its standard deviations of zero may be chance.
CHANCE_SIGMAS = 3.0


def check_facet(result: CaseDispersion, facet: int) -> None:
    """Refuse a facet that does not exist.

    Parameters
    ----------
    result : CaseDispersion
        The case.
    facet : int
        0-based.

    Raises
    ------
    InputRefused
        If there is no such facet.
    """
    count = len(result.facets)
    if not 0 <= facet < count:
        raise InputRefused("no such facet", where=f"--facet {facet}", fix=f"take one of 0 to {count - 1}")


def tell_facet(result: CaseDispersion, facet: int) -> str:
    """Say in one sentence how surely a facet is reachable, and what that depends on.

    Parameters
    ----------
    result : CaseDispersion
        The case.
    facet : int
        0-based.

    Raises
    ------
    InputRefused
        If there is no such facet.
    """
    check_facet(result, facet)
    row, drawing = result.facets[facet], result.drawing
    told = (
        f"facet {facet} is reachable in {row['reachable']} of {drawing.samples} samples: "
        f"probability {_share(row['probability'])}, {100 * drawing.confidence:g} % interval "
        f"{_share(row['probability_low'])} to {_share(row['probability_high'])}"
    )
    if row["unresolved"]:
        told += f", {row['unresolved']} unresolved ones taken either way"
    return f"{told}; {_reason(result, facet)}"


def facet_facts(result: CaseDispersion, facet: int) -> dict[str, Any]:
    """Every number known of a facet by name: its columns, and its correlation with each drawn quantity.

    Parameters
    ----------
    result : CaseDispersion
        The case.
    facet : int
        0-based.

    Raises
    ------
    InputRefused
        If there is no such facet.
    """
    check_facet(result, facet)
    row = result.facets[facet]
    facts: dict[str, Any] = {name: row[name].item() for name in row.dtype.names}
    facts["driver"] = Driver(facts["driver"]).name.lower()
    return {**facts, "correlation": correlations(result, facet)}


def correlations(result: CaseDispersion, facet: int) -> dict[str, float]:
    """Rank correlation of a facet's verdict with each drawn quantity, by name; NaN where there is none."""
    drawing = result.drawing
    drawn: FloatArray = deviations(drawing.spread, standard_normals(drawing.seed, drawing.samples))
    values = verdict_correlations(result.verdicts[:, facet : facet + 1], drawn)[:, 0]
    names = [driver.name.lower() for driver in drivers_of(drawing.spread.axes)]
    return dict(zip(names, values.tolist(), strict=True))


def _reason(result: CaseDispersion, facet: int) -> str:
    """What the verdict follows most, or that it never changes."""
    row = result.facets[facet]
    driver, value = Driver(int(row["driver"])), float(row["driver_correlation"])
    if driver is Driver.NONE:
        return "the verdict is the same in every sample"
    told = f"what matters most is {driver.words} (rank correlation {value:+.2f})"
    if abs(value) < CHANCE_SIGMAS / np.sqrt(max(result.drawing.samples - 1, 1)):
        told += ", which may be chance"
    return told


def _share(value: float) -> str:
    return f"{100 * value:.4g} %"

"""The numbers that a dispersed case is summed up in."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.mesh import facet_areas
from landing_cli.reach.records import LandingCase, Verdict
from landing_cli.studies.disperse.axes import state_axes
from landing_cli.studies.disperse.dispersed import dispersed_case
from landing_cli.studies.disperse.records import (
    SAMPLE_COLUMNS,
    Drawing,
    Driver,
    FloatArray,
    Verdicts,
    dtype_of,
)
from landing_cli.studies.disperse.statistics import count, rank_correlations, strongest

AREA_PERCENTILES = (5, 50, 95)


def sample_rows(case: LandingCase, drawing: Drawing, deviations: FloatArray) -> NDArray[np.void]:
    """List what was drawn for a case; the columns of answers are zero.

    Parameters
    ----------
    case : LandingCase
        Without deviation.
    drawing : Drawing
        How the samples were drawn.
    deviations : (samples, 9) float
        From `draws.deviations`.

    Returns
    -------
    (samples,) structured array of SAMPLE_COLUMNS
    """
    rows = np.zeros(len(deviations), dtype=dtype_of(SAMPLE_COLUMNS))
    rows["sample"] = np.arange(len(rows))
    turn = state_axes(case, drawing.spread.axes)
    for row, deviation in zip(rows, deviations, strict=True):
        drawn = dispersed_case(case, turn, deviation)
        row["position_m"], row["velocity_m_s"] = drawn.position_m, drawn.velocity_m_s
        row["mass_kg"], row["thrust_max_n"] = drawn.spacecraft.mass_kg, drawn.spacecraft.thrust_max_n
        row["gm_m3_s2"] = drawn.asteroid.gm_m3_s2
    return rows


def count_domains(rows: NDArray[np.void], case: LandingCase, verdicts: Verdicts) -> None:
    """Fill the answers of every sample: facets by verdict, and the domain's area.

    Parameters
    ----------
    rows : (samples,) structured array of SAMPLE_COLUMNS
        Filled.
    case : LandingCase
        Its mesh.
    verdicts : (samples, facets) uint8
        Of the case.
    """
    for verdict in Verdict:
        rows[verdict.name.lower()] = count(verdicts, verdict, 1)
    areas = facet_areas(case.asteroid.mesh)
    for sample, own in enumerate(verdicts):
        rows["reachable_area_m2"][sample] = areas[own == Verdict.REACHABLE].sum()


def summarise(
    facets: NDArray[np.void], samples: NDArray[np.void], drawing: Drawing, deviations: FloatArray
) -> dict[str, Any]:
    """Sum a dispersed case up.

    Parameters
    ----------
    facets, samples : structured arrays
        Its tables.
    drawing : Drawing
        How the samples were drawn.
    deviations : (samples, 9) float
        What they were.

    Returns
    -------
    dict
        As ``reach disperse --json`` prints it.
    """
    area = samples["reachable_area_m2"]
    correlation = rank_correlations(area, deviations)
    driver, value = strongest(correlation[:, None], drawing)
    width = facets["probability_high"] - facets["probability_low"]
    return {
        "facets": len(facets),
        "samples": len(samples),
        "seed": drawing.seed,
        "confidence": drawing.confidence,
        "always": int((facets["reachable"] == len(samples)).sum()),
        "sometimes": int(((facets["reachable"] > 0) & (facets["unreachable"] > 0)).sum()),
        "never": int((facets["unreachable"] == len(samples)).sum()),
        "unresolved": int(facets["unresolved"].sum(dtype=np.int64)),
        "reachable_mean": float(samples["reachable"].mean()),
        "reachable_area_m2": {
            "mean": float(area.mean()),
            **{f"p{p:02d}": float(np.percentile(area, p)) for p in AREA_PERCENTILES},
        },
        "widest_interval": float(width.max()),
        "driver": Driver(int(driver[0])).name.lower(),
        "driver_correlation": float(value[0]) if np.isfinite(value[0]) else None,
    }

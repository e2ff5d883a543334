"""Whether a stored dispersion can be true: what compiled code and printers take for granted of every file."""

from __future__ import annotations

from math import pi

import numpy as np

from landing_cli.body.asteroid import Asteroid
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored_checks import check_choices, check_printable, check_summary
from landing_cli.results.body_checks import bounded, positive
from landing_cli.studies.disperse.records import DRAWN, CaseDispersion, Drawing, Driver
from landing_cli.studies.disperse.statistics import count
from landing_cli.studies.disperse.summary import count_domains, summarise

LARGEST_SIGMA, MOST_SAMPLES, LARGEST_SEED = 1e9, 1_000_000, 2**53
# What is computed again may differ by so much where another processor adds up in another order.
_ROUNDING = 1e-9
_COUNTS = ("reachable", "unreachable", "unresolved")


def check_drawing(drawing: Drawing, asteroid: Asteroid, craft: Spacecraft) -> None:
    """Hold a drawing to what a scenario can have asked for.

    Parameters
    ----------
    drawing : Drawing
        As it was read.
    asteroid, craft : Asteroid, Spacecraft
        Whose GM, mass and thrust are dispersed.

    Raises
    ------
    ValueError
        If a number is impossible.
    """
    spread = drawing.spread
    if not (0 <= drawing.seed <= LARGEST_SEED and 1 <= drawing.samples <= MOST_SAMPLES):
        raise ValueError("no such seed, or no such number of samples")
    if not 0.5 <= drawing.confidence <= 0.9999:
        raise ValueError("confidence is no level")
    if spread.state_factor.shape != (6, 6) or spread.state_factor.dtype != np.float64:
        raise ValueError("state_factor is no 6 x 6 matrix")
    bounded("state_factor", spread.state_factor, LARGEST_SIGMA)
    for name, nominal in (
        ("mass_sigma_kg", craft.mass_kg),
        ("thrust_sigma_n", craft.thrust_max_n),
        ("gm_sigma_m3_s2", asteroid.gm_m3_s2),
    ):
        if not 0.0 <= getattr(spread, name) <= (0.1 + _ROUNDING) * nominal:
            raise ValueError(f"{name} is no sigma of {nominal:g}")


def check_case(result: CaseDispersion) -> None:
    """Hold a case to what can have been asked, and its tables to the verdicts.

    Parameters
    ----------
    result : CaseDispersion
        As it was read, its drawing checked.

    Raises
    ------
    ValueError
        If a quantity is impossible, or a table does not follow from the verdicts.
    """
    case, verdicts = result.case, result.verdicts
    for name, largest in (("tof_s", 1e7), ("final_stage_s", 1e7), ("ellipsoid_m", 1e9)):
        positive(name, getattr(case, name), largest)
    if not case.descent_s > 0.0 or not 0.0 < case.glide_slope_half_angle_rad <= pi / 2:
        raise ValueError("final_stage_s or glide_slope_half_angle_rad is out of range")
    for name, largest in (("position_m", 1e9), ("velocity_m_s", 1e6)):
        bounded(name, getattr(case, name), largest)
    check_choices(case)
    if not np.isin(verdicts, list(Verdict)).all():
        raise ValueError("verdicts holds a value without a meaning")
    for sample, facet in result.lost:
        if not (0 <= sample < verdicts.shape[0] and 0 <= facet < verdicts.shape[1]):
            raise ValueError("lost names what does not exist")
        if verdicts[sample, facet] != Verdict.UNRESOLVED:
            raise ValueError("what was lost has a verdict")
    _check_tables(result)


def _check_tables(result: CaseDispersion) -> None:
    """Hold what is counted to the verdicts, and what is drawn to numbers; `verify` draws again."""
    samples, facets, n = result.samples, result.facets, result.drawing.samples
    known = np.zeros(n, dtype=samples.dtype)
    count_domains(known, result.case, result.verdicts)
    for name, column, expected in (
        ("samples/sample", samples["sample"], np.arange(n)),
        ("facets/facet", facets["facet"], np.arange(result.verdicts.shape[1])),
        *((f"samples/{v}", samples[v], known[v]) for v in _COUNTS),
        *((f"facets/{v}", facets[v], count(result.verdicts, Verdict[v.upper()], 0)) for v in _COUNTS),
        ("samples/reachable_area_m2", samples["reachable_area_m2"], known["reachable_area_m2"]),
        ("facets/probability", facets["probability"], facets["reachable"] / n),
    ):
        if len(column) != len(expected) or not np.allclose(column, expected, rtol=_ROUNDING, atol=0.0):
            raise ValueError(f"{name} does not follow from the verdicts")
    for name, largest in (("position_m", 1e10), ("velocity_m_s", 1e10)):
        bounded(name, samples[name], largest)
    for name in ("mass_kg", "thrust_max_n", "gm_m3_s2"):
        positive(name, samples[name], 1e16)
    low, high, mean = facets["probability_low"], facets["probability_high"], facets["probability"]
    if not ((low >= 0.0) & (low <= mean) & (mean <= high) & (high <= 1.0)).all():
        raise ValueError("an interval does not hold its probability")
    if not np.isin(facets["driver"], list(Driver)).all():
        raise ValueError("driver holds a value without a meaning")
    bounded("driver_correlation", np.nan_to_num(facets["driver_correlation"], nan=0.0), 1.0 + _ROUNDING)
    _check_summary(result)


def _check_summary(result: CaseDispersion) -> None:
    drawing, summary = result.drawing, result.summary
    check_printable("summary", summary)
    known = summarise(result.facets, result.samples, drawing, np.zeros((drawing.samples, DRAWN)))
    check_summary(summary, {name: value for name, value in known.items() if name != "driver"})
    if summary.get("driver") not in [driver.name.lower() for driver in Driver]:
        raise ValueError("summary/driver is none")

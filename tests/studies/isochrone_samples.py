"""Made-up answers for isochrone studies, which many tests share: verdicts that come and go with time."""

from __future__ import annotations

import numpy as np

from landing_cli.reach.records import Verdict
from landing_cli.studies.isochrone.records import SAMPLE_DTYPE, Rows
from landing_cli.studies.isochrone.work import Items, Study

NO, YES, UNKNOWN = Verdict.UNREACHABLE, Verdict.REACHABLE, Verdict.UNRESOLVED


def made_up_verdict(state: int, facet: int, tof_s: float) -> Verdict:
    """From 500 s + 20 a facet; 3 is out of reach again, 5 comes twice, 6 is unknown at first, 7 never."""
    t = tof_s - 30.0 * state
    if facet == 7:
        return NO
    if facet == 5:
        return YES if 610.3 <= t < 700.7 or t >= 805.1 else NO
    if facet == 6:
        return NO if t < 620.2 else UNKNOWN if t < 640.4 else YES
    if facet == 3:
        return YES if 560.0 <= t < 910.9 else NO
    return YES if t >= 500.0 + 20.0 * facet else NO


def made_up_samples(study: Study, items: Items, prove: bool = True) -> Rows:
    """Stand for `work.solve_items`."""
    rows = np.zeros(len(items), dtype=SAMPLE_DTYPE)
    rows["item"] = np.sort(items)
    for row, state, place, facet in zip(rows, *study.parted(rows["item"]), strict=True):
        tof_s = float(study.grid.times_s(place))
        verdict = made_up_verdict(int(state), int(facet), tof_s)
        row["verdict"] = verdict
        row["proved"] = verdict == NO
        row["delta_v_m_s"] = row["performance_index_m2_s3"] = tof_s if verdict == YES else np.nan
    return rows

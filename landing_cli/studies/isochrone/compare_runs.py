"""Two isochrone studies side by side: facets gained and lost, and how first times moved."""

from __future__ import annotations

from typing import Any

import numpy as np

from landing_cli.errors import InputRefused
from landing_cli.reach.records import Verdict
from landing_cli.studies.isochrone.records import IsochroneRun, StateResult


def compare_runs(before: IsochroneRun, after: IsochroneRun) -> list[dict[str, Any]]:
    """Compare the initial states that two studies share.

    Parameters
    ----------
    before, after : IsochroneRun
        Over meshes of equally many facets.

    Returns
    -------
    list of dict
        One a shared state: ``case``, facets ``gained`` and ``lost`` (reachable at some time in one study
        only), facets ``earlier`` and ``later`` by more than both resolutions, and the median and largest
        change of the first time where both are reachable.

    Raises
    ------
    InputRefused
        The meshes differ in their number of facets, or no initial state has the same name.
    """
    sizes = [len(run.asteroid.mesh.faces) for run in (before, after)]
    if sizes[0] != sizes[1]:
        raise InputRefused(
            f"the meshes have {sizes[0]} and {sizes[1]} facets", fix="compare studies over one shape"
        )
    earlier = {case.case.name: case for case in before.cases}
    shared = [(earlier[case.case.name], case) for case in after.cases if case.case.name in earlier]
    if not shared:
        raise InputRefused("the studies have no initial state of the same name", fix="compare like with like")
    return [_compare(old, new) for old, new in shared]


def _compare(old: StateResult, new: StateResult) -> dict[str, Any]:
    was, now = (r.facets["verdict"] == Verdict.REACHABLE for r in (old, new))
    both = was & now
    change = (new.facets["first_tof_s"] - old.facets["first_tof_s"])[both]
    sharp = old.grid.finest_s + new.grid.finest_s
    return {
        "case": new.case.name,
        "gained": int((now & ~was).sum()),
        "lost": int((was & ~now).sum()),
        "earlier": int((change < -sharp).sum()),
        "later": int((change > sharp).sum()),
        "first_change_median_s": float(np.median(change)) if change.size else None,
        "first_change_largest_s": float(change[np.argmax(np.abs(change))]) if change.size else None,
    }

"""Two reach runs side by side: facets gained and lost, and how the shared ones changed."""

from __future__ import annotations

from typing import Any

import numpy as np

from landing_cli.errors import InputRefused
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import CaseResult, ReachRun


def compare_runs(before: ReachRun, after: ReachRun) -> list[dict[str, Any]]:
    """Compare the cases that two runs share.

    Parameters
    ----------
    before, after : ReachRun
        Over meshes of equally many facets.

    Returns
    -------
    list of dict
        One a shared case: ``case``, facets ``gained`` and ``lost`` (reachable in one run only), verdicts
        ``changed`` in any way, and the median and largest relative change of J where both are reachable.

    Raises
    ------
    InputRefused
        The meshes differ in their number of facets, or no case has the same name.
    """
    sizes = [len(run.asteroid.mesh.faces) for run in (before, after)]
    if sizes[0] != sizes[1]:
        raise InputRefused(
            f"the meshes have {sizes[0]} and {sizes[1]} facets", fix="compare runs over one shape"
        )
    earlier = {case.case.name: case for case in before.cases}
    shared = [(earlier[case.case.name], case) for case in after.cases if case.case.name in earlier]
    if not shared:
        raise InputRefused("the runs have no case of the same name", fix="compare runs of one scenario")
    return [_compare_cases(old, new) for old, new in shared]


def _compare_cases(old: CaseResult, new: CaseResult) -> dict[str, Any]:
    _, rows_old, rows_new = np.intersect1d(
        old.solutions.rows["facet"], new.solutions.rows["facet"], return_indices=True
    )
    a, b = old.solutions.rows[rows_old], new.solutions.rows[rows_new]
    was, now = a["verdict"] == Verdict.REACHABLE, b["verdict"] == Verdict.REACHABLE
    both = was & now
    change = np.abs(b["performance_index_m2_s3"][both] / a["performance_index_m2_s3"][both] - 1.0)
    return {
        "case": new.case.name,
        "gained": int((now & ~was).sum()),
        "lost": int((was & ~now).sum()),
        "changed": int((a["verdict"] != b["verdict"]).sum()),
        "j_change_median": float(np.median(change)) if change.size else None,
        "j_change_max": float(change.max()) if change.size else None,
    }

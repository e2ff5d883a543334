"""Two dispersions side by side: how far probabilities moved, and where for sure."""

from __future__ import annotations

from typing import Any

import numpy as np

from landing_cli.errors import InputRefused
from landing_cli.studies.disperse.records import CaseDispersion, DispersionRun


def compare_runs(before: DispersionRun, after: DispersionRun) -> list[dict[str, Any]]:
    """Compare the cases that two runs share.

    Parameters
    ----------
    before, after : DispersionRun
        Over meshes of equally many facets.

    Returns
    -------
    list of dict
        One a shared case: ``case``; facets ``surer`` and ``less_sure``, whose intervals lie apart; the
        largest and the mean change of the probability; and the change of the domain's mean area.

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


def _compare_cases(old: CaseDispersion, new: CaseDispersion) -> dict[str, Any]:
    a, b = old.facets, new.facets
    change = b["probability"] - a["probability"]
    area = new.summary["reachable_area_m2"]["mean"] - old.summary["reachable_area_m2"]["mean"]
    return {
        "case": new.case.name,
        "surer": int((b["probability_low"] > a["probability_high"]).sum()),
        "less_sure": int((b["probability_high"] < a["probability_low"]).sum()),
        "probability_change_max": float(np.abs(change).max()),
        "probability_change_mean": float(change.mean()),
        "area_change_m2": float(area),
    }

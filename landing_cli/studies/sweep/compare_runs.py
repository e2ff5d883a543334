"""Two sweeps side by side, case by case."""

from __future__ import annotations

from typing import Any

from landing_cli.errors import InputRefused
from landing_cli.reach.compare_runs import compare_cases, refuse_other_surface
from landing_cli.studies.sweep.records import SweepRun


def compare_runs(before: SweepRun, after: SweepRun) -> list[dict[str, Any]]:
    """Compare the cases that two sweeps share.

    Parameters
    ----------
    before, after : SweepRun
        Over one surface.

    Returns
    -------
    list of dict
        One a shared case, as for two runs of `reach run`.

    Raises
    ------
    InputRefused
        The surfaces differ, or no case has the same name.
    """
    refuse_other_surface(before.asteroid.mesh, after.asteroid.mesh)
    earlier = {case.name: case for case in before.cases}
    shared = [(earlier[case.name], case) for case in after.cases if case.name in earlier]
    if not shared:
        raise InputRefused("the sweeps have no case in common", fix="compare sweeps of one scenario")
    return [compare_cases(old.as_reach(), new.as_reach()) for old, new in shared]

"""The real command on a body of eight facets, killed by every signal and resumed."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from scenario_samples import write_minimal

sys.path.insert(0, str(Path(__file__).parents[1] / "torture"))

from kill_runs import kill_runs
from programs import Reference, reach_isochrone


@pytest.mark.slow
def test_killed_studies_resume_to_the_undisturbed_result(tmp_path: Path) -> None:
    scenario = write_minimal(tmp_path)
    sets = ("isochrone.tof_min_s=300", "isochrone.step_s=10", "isochrone.tolerance_s=0.1")
    reference = Reference.make(reach_isochrone(str(scenario), *sets), tmp_path, ("threads",))
    for tally in kill_runs(reference, 4, tmp_path, seed=3):
        assert tally.tried == 4
        assert not tally.failures

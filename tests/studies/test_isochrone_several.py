"""Facets of a real body that are reachable early and late but not in between."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenario_samples import ROOT

from landing_cli.body.resample import resampled
from landing_cli.parallel import WorkPlan
from landing_cli.reach import pipeline as reach_pipeline
from landing_cli.reach.records import Verdict
from landing_cli.scenario.load import load
from landing_cli.sources.shape_files import read_mesh, write_obj
from landing_cli.studies.isochrone import pipeline
from landing_cli.studies.isochrone.facet_story import tell_facet
from landing_cli.studies.isochrone.records import StateResult

VERTICES = 82  # 160 facets; the shipped shape has 2692
TIMES_S = np.arange(425.0, 826.0, 100.0)
# Head on at a speed that takes full thrust 684 m to stop; the keep-out zone begins 610 m away.
APPROACH = (
    "reach.initial_states=[{name: approach, position_km: [-1, 0, 0], velocity_m_s: [3.7, 0, 0]}]",
    "reach.ellipsoid_m=[390, 380, 365]",
)
RANGE = (
    f"isochrone.tof_min_s={TIMES_S[0]:g}",
    f"isochrone.tof_max_s={TIMES_S[-1]:g}",
    "isochrone.step_s=100",
    "isochrone.tolerance_s=25",
    f"reach.tof_s={TIMES_S.tolist()}",
)


@pytest.fixture(scope="module")
def coarse_bennu(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("approach") / "bennu.obj"
    write_obj(path, resampled(read_mesh(ROOT / "shapes" / "bennu.obj", "km"), VERTICES), [], "km")
    return f"body.shape={path}"


@pytest.fixture(scope="module")
def approached(coarse_bennu: str) -> StateResult:
    loaded = load(str(ROOT / "configs" / "bennu.yaml"), [coarse_bennu, *APPROACH, *RANGE])
    output = Path(coarse_bennu.partition("=")[2]).with_name("approach.h5")
    options = pipeline.RunOptions(WorkPlan(1))
    (result,) = pipeline.run(loaded, output, options, lambda done, total: None).run.cases
    return result


def test_a_braking_spacecraft_reaches_facets_before_and_after_a_gap(approached: StateResult) -> None:
    several = approached.facets["intervals"] > 1
    assert several.sum() >= 8
    verdict, proved = approached.answers.verdict[:, several], approached.answers.proved[:, several]
    assert (verdict[0] == Verdict.REACHABLE).all()
    gone = verdict == Verdict.UNREACHABLE
    assert gone[1:3].all()  # 525 and 625 s
    assert proved[1:3].all()
    assert (verdict[-1] == Verdict.REACHABLE).mean() > 0.9


def test_the_gap_is_told_with_its_proofs(approached: StateResult) -> None:
    facet = int(np.flatnonzero(approached.facets["intervals"] > 1)[0])
    told = tell_facet(approached, facet)
    assert told.count("(not at") >= 2
    assert "of the times asked in between" in told


def test_single_runs_see_the_same_gap(approached: StateResult, coarse_bennu: str, tmp_path: Path) -> None:
    loaded = load(str(ROOT / "configs" / "bennu.yaml"), [coarse_bennu, *APPROACH, *RANGE[-1:]])
    options = reach_pipeline.RunOptions(WorkPlan(1))
    cases = reach_pipeline.run(loaded, tmp_path / "run.h5", options, lambda done, total: None).run.cases
    assert [case.case.tof_s for case in cases] == TIMES_S.tolist()
    for k, case in enumerate(cases):
        rows = case.solutions.rows
        assert rows["verdict"].tolist() == approached.answers.verdict[k].tolist()
        assert rows["proved"].tolist() == approached.answers.proved[k].tolist()

"""A small body solved, stored, read and flown again under its polyhedron, interpolated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenario_samples import write_minimal
from test_store import PROVENANCE, ROOT

from landing_cli.body.gravity.field import GravityKind
from landing_cli.errors import InputRefused
from landing_cli.parallel.plan import WorkPlan
from landing_cli.reach.pipeline import RunOptions, run
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import ReachRun, run_from_result, run_to_tree
from landing_cli.reach.verify import verify_run
from landing_cli.results.store import read, write
from landing_cli.scenario.load import load


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("interpolated")


@pytest.fixture(scope="module")
def runs(folder: Path) -> dict[str, ReachRun]:
    """The same two cases under three fields, read back from their files."""
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        for name in ("point_mass", "polyhedron", "interpolated"):
            gravity = f"body.gravity={{model: {name}, density_kg_m3: 2000}}"
            loaded, output = load(str(write_minimal(folder)), [gravity]), folder / f"{name}.h5"
            run(loaded, output, RunOptions(WorkPlan(jobs=2)), lambda done, total: None, lambda text: None)
            found[name] = run_from_result(read(output))
    return found


def test_the_domain_is_that_under_the_polyhedron(runs: dict[str, ReachRun]) -> None:
    for exact, fitted in zip(runs["polyhedron"].cases, runs["interpolated"].cases, strict=True):
        assert fitted.case.asteroid.gravity.kind is GravityKind.INTERPOLATED
        known, rows = exact.solutions.rows, fitted.solutions.rows
        np.testing.assert_array_equal(rows["verdict"], known["verdict"])
        reachable = rows["verdict"] == Verdict.REACHABLE
        assert reachable.any()
        np.testing.assert_allclose(
            rows["performance_index_m2_s3"][reachable],
            known["performance_index_m2_s3"][reachable],
            rtol=1e-4,
            atol=0,
        )


def test_flights_land_under_the_polyhedron_too(runs: dict[str, ReachRun]) -> None:
    misses = {}
    for name in ("point_mass", "interpolated"):
        reports = verify_run(runs[name].cases)
        assert all(report.verified for report in reports)
        misses[name] = max(report.polyhedron.worst_m for report in reports if report.polyhedron)
    assert misses["interpolated"] < 0.05
    assert misses["point_mass"] > 20.0 * misses["interpolated"]


def test_a_stored_field_that_leads_astray_is_refused(folder: Path, runs: dict[str, ReachRun]) -> None:
    tree = run_to_tree(runs["interpolated"])
    body = tree.group("body")
    params = body.dataset("gravity_params").data.copy()
    params[0] += 1.0
    forged = replace(body.dataset("gravity_params"), data=params)
    members = {**tree.members, "body": replace(body, members={**body.members, "gravity_params": forged})}
    path = folder / "forged.h5"
    write(path, replace(tree, members=members), ROOT, PROVENANCE)
    with pytest.raises(InputRefused, match="do not fit the model interpolated"):
        run_from_result(read(path))

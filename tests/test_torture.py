"""The short form of the torture, on a stand-in; ``make torture`` is the long one, on the real command."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent / "torture"))

from choices import choices
from forge_results import forge_results
from hostile_inputs import SCENARIOS, SHAPES, hostile_inputs
from kill_runs import kill_runs
from kill_workers import deadly_facet, kill_workers
from programs import TOY, Reference

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("torture")


@pytest.fixture(scope="module")
def reference(folder: Path) -> Any:
    return Reference.make(TOY, folder)


def test_eight_killed_runs_resume_to_the_undisturbed_result(reference: Any, folder: Path) -> None:
    for tally in kill_runs(reference, 8, folder, seed=1):
        assert tally.tried == 4
        assert not tally.failures


def test_killed_workers_cost_nothing(reference: Any, folder: Path) -> None:
    assert not kill_workers(reference, 1, folder, seed=1).failures


def test_a_facet_that_kills_its_worker_is_named_and_tried_again(reference: Any, folder: Path) -> None:
    assert not deadly_facet(reference, folder).failures


def test_every_output_that_is_there_already_is_told_with_the_choices(reference: Any, folder: Path) -> None:
    assert not choices(reference, folder).failures


def test_every_hostile_scenario_and_shape_is_told_by_name_at_little_cost() -> None:
    scenarios, shapes = hostile_inputs()
    assert (scenarios.tried, shapes.tried) == (len(SCENARIOS), len(SHAPES))
    assert not scenarios.failures
    assert not shapes.failures


def test_a_forged_result_is_refused_or_harmless(folder: Path) -> None:
    tally = forge_results(folder, every=600)
    assert not tally.failures
    assert tally.tried >= 2

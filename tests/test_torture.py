"""The short form of the torture; ``python tests/torture --kills 200`` is the long one."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent / "torture"))

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


def test_ten_killed_runs_resume_to_the_undisturbed_result(reference: Any, folder: Path) -> None:
    for tally in kill_runs(reference, 10, folder, seed=1):
        assert tally.tried == 5
        assert not tally.failures


def test_killed_workers_cost_nothing(reference: Any, folder: Path) -> None:
    assert not kill_workers(reference, 1, folder, seed=1).failures


def test_a_facet_that_kills_its_worker_is_named_and_tried_again(reference: Any, folder: Path) -> None:
    assert not deadly_facet(reference, folder).failures

"""Every leaf of every shipped scenario, damaged in every way: exit 3, the dotted key, nothing left behind."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent / "torture"))

from damage_scenarios import SHIPPED, damage_scenario


@pytest.mark.parametrize("source", SHIPPED, ids=lambda path: path.stem)
def test_every_damaged_leaf_is_refused_by_its_key(source: Path) -> None:
    tally = damage_scenario(source)
    assert not tally.failures
    assert tally.tried > 150

"""Results forged with a valid seal: what no run can have found is refused by name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_store import PROVENANCE, ROOT, make_run

from landing_cli.errors import InputRefused
from landing_cli.reach.stored import run_from_result, run_to_tree
from landing_cli.results.store import read, write
from landing_cli.results.tree import Dataset, Group

FORGED = {
    "complete": (np.array([1.0, 2.0]), "does not say whether it is complete"),
    "schema_version": (np.array([1, 1]), "schema version"),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_list_in_the_place_of_a_number_is_refused(tmp_path: Path, name: str) -> None:
    """A forger seals what he writes: the digest fits."""
    path, (value, told) = tmp_path / "forged.h5", FORGED[name]
    write(path, run_to_tree(make_run()), {**ROOT, name: value}, PROVENANCE)
    with pytest.raises(InputRefused, match=told):
        read(path)


@pytest.mark.parametrize(
    ("group", "name", "value", "told"),
    [
        ("spacecraft", "mass_kg", np.array([1.0, 2.0]), "mass_kg is no number"),
        ("body", "rotation_rate_rad_s", -1e-3, "rotation_rate_rad_s is negative"),
    ],
)
def test_a_run_that_no_kernel_could_bear_is_refused(
    tmp_path: Path, group: str, name: str, value: object, told: str
) -> None:
    tree = run_to_tree(make_run())
    part = tree.group(group)
    forged = replace(part, attributes={**part.attributes, name: value})
    path = tmp_path / "forged.h5"
    write(path, replace(tree, members={**tree.members, group: forged}), ROOT, PROVENANCE)
    with pytest.raises(InputRefused, match=told):
        run_from_result(read(path))


def test_a_facet_without_area_is_refused(tmp_path: Path) -> None:
    tree = run_to_tree(make_run())
    body = tree.group("body")
    flat = replace(body.dataset("vertices"), data=np.zeros_like(body.dataset("vertices").data))
    forged = replace(body, members={**body.members, "vertices": flat})
    path = tmp_path / "flat.h5"
    write(path, replace(tree, members={**tree.members, "body": forged}), ROOT, PROVENANCE)
    with pytest.raises(InputRefused, match="a facet has no area"):
        run_from_result(read(path))


def test_a_section_that_lacks_a_list_is_refused(tmp_path: Path) -> None:
    tree = run_to_tree(make_run())
    lists = ("section_facets", "ring_facets", "boundary_facets")
    members: dict[str, Dataset | Group] = {
        name: Dataset(np.arange(3, dtype=np.int32), "1", "facets", (f"{name}_point",)) for name in lists
    }
    members["domain"] = Dataset(np.zeros(12, dtype=np.uint8), "1", "the domain", ("surface",))
    name = sorted(tree.group("cases").members)[0]
    case = tree.group("cases", name)
    forged = replace(case, members={**case.members, "boundary": Group(members)})
    cases = replace(tree.group("cases"), members={**tree.group("cases").members, name: forged})
    path = tmp_path / "section.h5"
    write(path, replace(tree, members={**tree.members, "cases": cases}), ROOT, PROVENANCE)
    with pytest.raises(InputRefused, match="boundary lacks a list of the section"):
        run_from_result(read(path))

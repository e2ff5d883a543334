"""landing results diff of reach runs: areas, margins, bindings, which facets, maps, and other surfaces."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from test_cli_results import FACETS, NO, TETRAHEDRON, YES, stored_run

from landing_cli.body.mesh import Mesh, facet_areas
from landing_cli.cli.app import main
from landing_cli.errors import ExitCode, InputRefused
from landing_cli.reach.compare_runs import refuse_other_surface
from landing_cli.reach.records import Binding, Verdict

MARGIN = [0.3, 0.1, -0.1, -0.2]


@pytest.fixture
def pair(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """Two runs: facet 1 lost, facet 2 gained, another constraint on facets 0 and 3."""
    monkeypatch.chdir(tmp_path)
    thrust, glide, ellipsoid = Binding.THRUST, Binding.GLIDE_SLOPE, Binding.ELLIPSOID
    known: dict[str, list[float]] = {
        "thrust_margin": MARGIN,
        "binding": [glide, glide, thrust, thrust],
    }
    old = stored_run(tmp_path / "a.h5", [YES, YES, NO, NO], known=known)
    known = {
        "thrust_margin": [0.35, -0.1, 0.05, np.nan],
        "binding": [thrust, thrust, glide, ellipsoid],
    }
    new = stored_run(tmp_path / "b.h5", [YES, NO, YES, NO], j=1.9, known=known)
    return old, new


def test_areas_margins_and_bindings_are_compared(
    pair: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main("landing", ["results", "diff", *map(str, pair), "--json", "-q"]) == 0
    (case,) = json.loads(capsys.readouterr().out)["cases"]
    areas = facet_areas(TETRAHEDRON)
    assert (case["gained"], case["lost"], case["changed"]) == (1, 1, 2)
    assert (case["area_gained_m2"], case["area_lost_m2"]) == pytest.approx((areas[2], areas[1]))
    assert case["j_change_max"] == pytest.approx(0.05)
    assert case["margins_compared"] == 3
    changes = [case[f"margin_change_{part}"] for part in ("min", "median", "max")]
    assert changes == pytest.approx([-0.2, 0.05, 0.15])
    assert case["binding_changed"] == 2
    assert case["binding_changes"] == {"glide_slope -> thrust": 1, "thrust -> ellipsoid": 1}
    told = {facet["facet"]: facet["change"] for facet in case["facets"]}
    assert told == {0: "binding", 1: "lost", 2: "gained", 3: "binding"}
    lost = case["facets"][1]
    assert (lost["verdict_before"], lost["verdict_after"]) == ("reachable", "unreachable")
    assert (lost["performance_index_m2_s3_before"], lost["performance_index_m2_s3_after"]) == (2.0, None)


def test_equal_runs_differ_in_nothing(pair: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert main("landing", ["results", "diff", str(pair[0]), str(pair[0]), "--json"]) == 0
    (case,) = json.loads(capsys.readouterr().out)["cases"]
    assert case["facets"] == []
    assert case["binding_changes"] == {}
    assert case["area_gained_m2"] == case["area_lost_m2"] == case["margin_change_max"] == 0.0


def test_there_and_back_exchanges_gain_and_loss(
    pair: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    found = []
    for way in (pair, pair[::-1]):
        assert main("landing", ["results", "diff", *map(str, way), "--json", "-q"]) == 0
        (case,) = json.loads(capsys.readouterr().out)["cases"]
        found.append(case)
    assert found[0]["area_gained_m2"] == found[1]["area_lost_m2"]
    assert found[0]["margin_change_min"] == -found[1]["margin_change_max"]


def test_the_facets_go_to_a_table_and_the_maps_to_files(
    pair: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["results", "diff", "a.h5", "b.h5", "--table", "x.csv", "--plot", "-o", "maps"]
    assert main("landing", command) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[1].split()[:4] == ["top_700s", "1", "1", "2"]
    assert "wrote x.csv\n" in err
    assert "wrote maps/a-b-top_700s-diff.png\n" in err
    rows = list(csv.DictReader((tmp_path / "x.csv").read_text().splitlines()))
    assert [(row["case"], row["facet"], row["change"]) for row in rows] == [
        ("top_700s", "0", "binding"),
        ("top_700s", "1", "lost"),
        ("top_700s", "2", "gained"),
        ("top_700s", "3", "binding"),
    ]
    assert (tmp_path / "maps/a-b-top_700s-diff.png").read_bytes().startswith(b"\x89PNG")
    assert main("landing", ["results", "diff", "a.h5", "b.h5", "--table", "x.csv"]) == ExitCode.REFUSED
    assert "x.csv: is there already" in capsys.readouterr().err
    assert main("landing", ["results", "diff", "a.h5", "b.h5", "--table", "x.csv", "--force", "-q"]) == 0
    kept = (tmp_path / "a.h5").read_bytes()
    forced = ["results", "diff", "a.h5", "b.h5", "--table", "a.h5", "--force"]
    assert main("landing", forced) == ExitCode.REFUSED
    assert (tmp_path / "a.h5").read_bytes() == kept


def test_a_folder_without_a_figure_is_a_mistake_of_usage(
    pair: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main("landing", ["results", "diff", "a.h5", "b.h5", "-o", "maps"]) == ExitCode.USAGE
    assert "--out: is the folder for figures; add --plot" in capsys.readouterr().err


def test_other_surfaces_of_as_many_facets_are_refused_by_their_hashes() -> None:
    moved = TETRAHEDRON.vertices.copy()
    moved[1, 0] += 0.01
    with pytest.raises(InputRefused, match=r"4 facets each, but are different surfaces \(sha256 [0-9a-f]"):
        refuse_other_surface(TETRAHEDRON, Mesh(moved, TETRAHEDRON.faces))
    turned = TETRAHEDRON.faces[[1, 0, 2, 3]]
    with pytest.raises(InputRefused, match="another place on the other"):
        refuse_other_surface(TETRAHEDRON, Mesh(TETRAHEDRON.vertices, turned))
    fewer = Mesh(TETRAHEDRON.vertices, TETRAHEDRON.faces[:3])
    with pytest.raises(InputRefused, match="the meshes have 4 and 3 facets"):
        refuse_other_surface(TETRAHEDRON, fewer)


def test_the_same_surface_about_another_origin_compares() -> None:
    shifted = Mesh(TETRAHEDRON.vertices + np.array([3.7, -2.1, 0.3]), TETRAHEDRON.faces)
    refuse_other_surface(TETRAHEDRON, shifted)
    assert len(shifted.faces) == FACETS
    assert Verdict.REACHABLE == YES

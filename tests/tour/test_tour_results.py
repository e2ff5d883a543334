"""Tours in files: what is stored comes back, is exported, drawn, and refused where it is forged."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tour_samples import chain, escape_run, facts, path, tour_run, write_run

from landing_cli.cli.app import main
from landing_cli.errors import ExitCode, InputRefused
from landing_cli.results.store import read, write
from landing_cli.results.tree import Group, digest
from landing_cli.tour.recorded import (
    chain_from_arrays,
    chain_to_arrays,
    outcome_from_arrays,
    outcome_to_arrays,
)
from landing_cli.tour.records import SearchOutcome
from landing_cli.tour.run_records import ChainEntry, TourRun
from landing_cli.tour.stored import run_from_result, run_to_tree, used_targets
from landing_cli.tour.summary import best_first, front


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return write_run(tmp_path / "tour.h5", tour_run())


@pytest.mark.parametrize(
    "run", [tour_run(), tour_run("compare"), escape_run()], ids=["search", "compare", "escape"]
)
def test_a_run_comes_back_from_its_file(tmp_path: Path, run: Any) -> None:
    again = run_from_result(read(write_run(tmp_path / "run.h5", run)))
    assert digest(run_to_tree(again)) == digest(run_to_tree(run))
    assert [entry.name for entry in again.cases] == [entry.name for entry in run.cases]


def test_a_run_without_chains_keeps_what_came_nearest(tmp_path: Path) -> None:
    run = TourRun((), facts(), (), chain(0.0, "broken"))
    again = run_from_result(read(write_run(tmp_path / "none.h5", run)))
    assert isinstance(again, TourRun)
    assert again.nearest is not None
    assert again.nearest.message == "the first leg passes the Moon"


def test_a_chain_comes_back_from_the_journal() -> None:
    found, flown = chain_from_arrays(chain_to_arrays(chain(), path()))
    assert found.nbody_delta_v_m_s == chain().nbody_delta_v_m_s
    assert flown is not None
    np.testing.assert_array_equal(flown.arc, path().arc)
    broken, nothing = chain_from_arrays(chain_to_arrays(chain(0.0, "broken")))
    assert (broken.status, broken.nbody_legs, nothing) == ("broken", None, None)
    assert np.isnan(broken.nbody_delta_v_m_s)


def test_a_search_comes_back_from_the_journal() -> None:
    outcome = SearchOutcome(tuple(chain(float(i)) for i in range(12)), tour_run().depths, chain(99.0))
    again = outcome_from_arrays(outcome_to_arrays(outcome))
    assert [c.delta_v_m_s for c in again.chains] == [c.delta_v_m_s for c in outcome.chains]
    assert again.depths == outcome.depths
    assert again.nearest is not None
    assert again.nearest.delta_v_m_s == chain(99.0).delta_v_m_s


def test_a_journal_record_of_another_version_is_refused() -> None:
    arrays = chain_to_arrays(chain())
    with pytest.raises(InputRefused, match="journal record"):
        chain_from_arrays({name: value for name, value in arrays.items() if name != "legs"})


def test_targets_that_no_chain_passes_are_dropped_and_the_rest_renumbered() -> None:
    short = replace(chain(), legs=chain().legs[1:], nbody_legs=None, flybys=())
    kept, (again,) = used_targets([short], facts().targets)
    assert kept.designations == ("2018 QE",)
    assert [leg.target for leg in again.legs] == [0]


@pytest.mark.parametrize(
    ("member", "attribute", "value", "told"),
    [
        ("chain_01", "status", "splendid", "'splendid' is none of hint, flown, broken"),
        ("chain_01", "targets", ("12923",), "argument"),
        ("departure", "t_s", "noon", "t_s is no number"),
        ("", "method", "luck", "'luck' is none of beam, layered"),
    ],
)
def test_forged_runs_are_refused(tmp_path: Path, member: str, attribute: str, value: Any, told: str) -> None:
    tree = run_to_tree(tour_run())
    if member == "chain_01":
        old = tree.group("cases", "chain_01")
        cases = {
            **tree.group("cases").members,
            "chain_01": Group(old.members, {**old.attributes, attribute: value}),
        }
        forged = Group({**tree.members, "cases": Group(cases)}, tree.attributes)
    elif member:
        old = tree.group(member)
        group = Group(old.members, {**old.attributes, attribute: value})
        forged = Group({**tree.members, member: group}, tree.attributes)
    else:
        forged = Group(tree.members, {**tree.attributes, attribute: value})
    whole = read(write_run(tmp_path / "whole.h5", tour_run()))
    write(tmp_path / "forged.h5", forged, {**whole.identity.as_dict(), "complete": 1}, {})
    with pytest.raises(InputRefused, match="lacks a part or holds a wrong one") as refused:
        run_from_result(read(tmp_path / "forged.h5"))
    assert told in str(refused.value)


def test_the_front_keeps_what_no_other_beats() -> None:
    run = tour_run()
    assert [entry.name for entry in front(run.cases)] == ["chain_01"]
    longer = replace(
        chain(500.0), legs=(*chain().legs, chain().legs[1]), nbody_legs=(*chain().legs, chain().legs[1])
    )
    both = (run.cases[0], ChainEntry("long", longer, None, run.facts))
    assert [entry.name for entry in front(both)] == ["chain_01", "long"]


def test_the_best_chain_has_most_asteroids_then_least_delta_v() -> None:
    short = replace(chain(), legs=chain().legs[:1], nbody_legs=chain().legs[:1])
    assert best_first([short, chain(9.0), chain(1.0)]) == [2, 1, 0]


def test_show_prints_chains_and_the_contracts_fields(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main("landing", ["results", "show", str(file)]) == 0
    out, err = capsys.readouterr()
    assert "chain_01" in out
    assert "tour search" in err
    assert main("landing", ["results", "show", str(file), "--json", "-q"]) == 0
    told = json.loads(capsys.readouterr().out)
    first = told["chains"][0]
    assert first["targets"] == ["12923", "2018 QE"]
    assert first["nbody_delta_v_m_s"] == pytest.approx(chain().nbody_delta_v_m_s)
    assert first["duration_d"] == pytest.approx(200.0)
    assert first["flybys"][0]["speed_m_s"] == pytest.approx(5000.0)
    assert first["flybys"][0]["geocentric_distance_km"] == pytest.approx(3e7)
    assert {"phase_angle_deg", "diameter_m", "apparent_magnitude"} <= set(first["flybys"][0])
    assert told["broken"][0]["message"] == "the first leg passes the Moon"


def test_export_writes_tables_and_an_oem(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main("landing", ["results", "export", str(file), "-q"]) == 0
    summary = list(csv.DictReader(capsys.readouterr().out.splitlines()))
    assert [row["name"] for row in summary] == ["chain_01", "chain_02"]
    assert summary[0]["targets"] == "12923; 2018 QE"
    assert main("landing", ["results", "export", str(file), "--table", "flybys", "-q"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 5
    arguments = ["results", "export", str(file), "--case", "chain_01", "--format", "oem", "-q"]
    assert main("landing", arguments) == 0
    oem = capsys.readouterr().out
    assert oem.count("META_START") == 3
    for line in ("CENTER_NAME = SUN", "REF_FRAME = ICRF", "TIME_SYSTEM = TDB", "OBJECT_NAME = PROBE"):
        assert line in oem
    # 7766 d and 17600 s after noon of 2000-01-01
    assert "START_TIME = 2021-04-06T16:53:20.000000" in oem
    x, y, z = (float(value) for value in oem.splitlines()[-1].split()[1:4])
    last = path().position_m[-1] / 1e3
    assert [x, y, z] == pytest.approx([last[0], last[1] * 0.917482062, last[1] * 0.397777156], rel=1e-9)


def test_a_trajectory_is_of_one_chain(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main("landing", ["results", "export", str(file), "--format", "oem"]) == ExitCode.USAGE
    assert "a trajectory is of one case; take one of chain_01, chain_02" in capsys.readouterr().err


def test_a_tour_has_no_facets(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main("landing", ["results", "show", str(file), "--facet", "1"]) == ExitCode.USAGE
    assert "a result of tour has no facets" in capsys.readouterr().err


def test_plot_draws_the_front_and_its_trajectories(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main("landing", ["results", "plot", str(file), "-q"]) == 0
    drawn = [Path(line).name for line in capsys.readouterr().out.split()]
    assert drawn == ["tour-front.png", "tour-chain_01-trajectory.png"]
    assert all((tmp_path / name).stat().st_size > 20_000 for name in drawn)


def test_plot_draws_escape_maps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write_run(tmp_path / "away.h5", escape_run())
    assert main("landing", ["results", "plot", str(file), "-q"]) == 0
    assert capsys.readouterr().out.strip().endswith("away-moon-escape.png")


def test_escape_maps_are_shown_exported_and_verified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write_run(tmp_path / "away.h5", escape_run())
    assert main("landing", ["results", "show", str(file), "--json", "-q"]) == 0
    assert json.loads(capsys.readouterr().out)["corners"][0]["printed_least_m_s"] == 31.0
    assert main("landing", ["results", "export", str(file), "-q"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 21
    assert main("landing", ["results", "verify", str(file), "-q"]) == 0
    forged = escape_run()
    forged.cases[0].delta_v_m_s[1, 2] += 0.001
    file = write_run(tmp_path / "forged.h5", forged)
    assert main("landing", ["results", "verify", str(file), "-q"]) == ExitCode.VERIFICATION_FAILED
    assert "energy_m_s 0.001" in capsys.readouterr().err


def test_diff_tells_what_changed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = write_run(tmp_path / "one.h5", replace(tour_run(), cases=tour_run().cases[:1]))
    other = write_run(tmp_path / "other.h5", replace(tour_run(), cases=tour_run().cases[:1], broken=()))
    assert main("landing", ["results", "diff", str(one), str(other), "--json", "-q"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert not told["equal"]
    assert told["cases"][0]["nbody_delta_v_change_m_s"] == 0.0

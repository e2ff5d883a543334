"""A stored dispersion comes back equal, is told, drawn and exported, and every lie in it is found."""

from __future__ import annotations

import csv
import io
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dispersion_samples import FACETS, SAMPLES, solve_boulder
from numpy.testing import assert_allclose

from landing_cli.cli import disperse as printer
from landing_cli.cli.app import main
from landing_cli.errors import ExitCode, InputRefused
from landing_cli.reach.records import Verdict
from landing_cli.results.store import StoredResult, read, write
from landing_cli.results.tree import Dataset, Group, digest
from landing_cli.studies.disperse import verify
from landing_cli.studies.disperse.draws import deviations, standard_normals
from landing_cli.studies.disperse.figures import write_figures
from landing_cli.studies.disperse.figures.samples import running_interval
from landing_cli.studies.disperse.pipeline import case_dispersion
from landing_cli.studies.disperse.records import DispersionRun
from landing_cli.studies.disperse.stored import run_from_result, run_to_tree

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "torture"))

from forge_results import forgeries


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("good")
    solve_boulder(folder)
    return folder / "run.h5"


@pytest.fixture(scope="module")
def run(good: Path) -> DispersionRun:
    return run_from_result(read(good))


def results(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> tuple[str, str]:
    assert main("landing", ["results", *arguments]) == code, capsys.readouterr().err
    return capsys.readouterr()


def forged(run: DispersionRun, good: Path, path: Path) -> str:
    """Store a run under the seal and identity of the good one."""
    result = read(good)
    write(path, run_to_tree(run), {**result.tree.attributes}, dict(result.provenance))
    return str(path)


def test_a_run_comes_back_equal_in_every_number(good: Path, run: DispersionRun) -> None:
    stored = read(good)
    tree = run_to_tree(run)
    assert digest(Group(tree.members)) == digest(Group(stored.tree.members))
    assert stored.mission == "dispersion"
    assert run.drawing.samples == SAMPLES
    assert_allclose(run.drawing.spread.sigmas, [10, 10, 10, 0.01, 0.01, 0.01, 10, 1, 0.049], rtol=1e-12)
    first, second = run.cases
    assert (first.samples["mass_kg"] == second.samples["mass_kg"]).all()  # all cases share the draws
    assert (first.verdicts != second.verdicts).any()


def test_verification_passes_and_counts_what_it_did(
    good: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(verify, "SAMPLES", 5)
    value = json.loads(results(capsys, "verify", str(good), "--json", "-q")[0])
    assert value["verified"] is True
    for case in value["cases"]:
        assert case["pairs"] >= 40
        assert case["flights"] > 20
        assert case["worst"]["touchdown_miss_m"]["value"] < 1e-3
        assert case["worst"]["draws_apart"]["value"] == case["worst"]["tables_apart"]["value"] == 0.0
    table, _ = results(capsys, "verify", str(good), "--case", "high_600s", "-q", "--jobs", "2")
    assert table.splitlines()[1].split()[-1] == "verified"


def resummed(run: DispersionRun, verdicts: np.ndarray) -> DispersionRun:
    """The run with other verdicts in its first case, and every table that follows from them."""
    first, drawing = run.cases[0], run.drawing
    drawn = deviations(drawing.spread, standard_normals(drawing.seed, drawing.samples))
    other = case_dispersion(first.case, first.initial_state, drawing, drawn, verdicts, {})
    return DispersionRun((other, *run.cases[1:]))


def test_a_verdict_that_is_not_that_of_the_solver_is_found(
    good: Path, run: DispersionRun, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdicts = run.cases[0].verdicts.copy()
    facet = int(run.cases[0].facets["facet"][run.cases[0].facets["reachable"] == SAMPLES][0])
    verdicts[3, facet] = Verdict.UNREACHABLE  # now its samples disagree, so that it is asked again
    path = forged(resummed(run, verdicts), good, tmp_path / "f.h5")
    _, err = results(capsys, "verify", path, "-q", "--case", "high_700s", code=ExitCode.VERIFICATION_FAILED)
    assert f"facet {facet} of sample 3: solved again, its verdict is another" in err


def table_forged(run: DispersionRun, table: str, column: str, change: Callable[[Any], Any]) -> DispersionRun:
    first = run.cases[0]
    rows = getattr(first, table).copy()
    rows[column] = change(rows[column])
    return DispersionRun((replace(first, **{table: rows}), *run.cases[1:]))


@pytest.mark.parametrize(
    ("table", "column", "change", "told"),
    [
        ("samples", "mass_kg", lambda x: x + 1e-4, "draws_apart"),
        ("samples", "position_m", lambda x: x * (1 + 1e-7), "draws_apart"),
        ("samples", "gm_m3_s2", lambda x: x[::-1], "draws_apart"),
        ("facets", "probability_low", lambda x: 0.99 * x, "tables_apart"),
        ("facets", "probability_high", lambda x: np.minimum(1.0, x + 0.01), "tables_apart"),
        ("facets", "driver_correlation", lambda x: -0.5 * x, "tables_apart"),
    ],
)
def test_draws_and_tables_that_do_not_follow_from_the_seed_fail(
    table: str, column: str, change: Callable[[Any], Any], told: str, good: Path, run: DispersionRun,
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(verify, "SAMPLES", 0)  # nothing is solved again here
    path = forged(table_forged(run, table, column, change), good, tmp_path / "f.h5")
    _, err = results(capsys, "verify", path, "-q", code=ExitCode.VERIFICATION_FAILED)
    assert told in err


@pytest.mark.parametrize(
    ("table", "column", "change"),
    [
        ("facets", "reachable", lambda x: x[::-1]),
        ("facets", "probability", lambda x: 0.5 * x),
        ("facets", "probability_low", lambda x: x + 1.0),
        ("facets", "driver", lambda x: x + 40),
        ("samples", "unreachable", lambda x: x + 1),
        ("samples", "reachable_area_m2", lambda x: 2.0 * x),
        ("samples", "thrust_max_n", lambda x: -x),
    ],
)
def test_tables_that_contradict_the_verdicts_are_refused(
    table: str, column: str, change: Callable[[Any], Any], good: Path, run: DispersionRun,
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    path = forged(table_forged(run, table, column, change), good, tmp_path / "f.h5")
    _, err = results(capsys, "show", path, code=ExitCode.REFUSED)
    assert "lacks a part or holds a wrong one" in err


def test_every_forged_value_is_refused_or_read_without_harm(
    good: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As `make torture` forges reach runs: one impossible value at a time, past our own writer."""
    result = read(good)
    parts = {name: m for name, m in result.tree.members.items() if name != "body"}
    tried = refused = 0
    for told, tree in forgeries(
        Group({**parts, "cases": Group({"high_700s": result.tree.group("cases", "high_700s")})})
    ):
        if tried % 3 == 0 or "verdicts" in told or "drawing" in told:
            whole = Group({**tree.members, "body": result.tree.members["body"]}, result.tree.attributes)
            other = StoredResult(result.path, whole, {}, "")
            try:
                found = run_from_result(other)
                printer.print_run(found, good, as_json=True)
                printer.print_facet(found.cases, 0, good, as_json=True)
            except InputRefused:
                refused += 1
        tried += 1
    assert tried > 400
    assert refused > 150


def test_a_facet_is_told_in_a_sentence(
    good: Path, run: DispersionRun, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = run.cases[0].facets
    facet = int(np.flatnonzero((rows["reachable"] > 0) & (rows["unreachable"] > 0))[0])
    out, _ = results(capsys, "show", str(good), "--facet", str(facet), "--case", "high_700s")
    count = rows["reachable"][facet]
    assert (
        f"high_700s: facet {facet} is reachable in {count} of 10 samples: probability {10 * count} %" in out
    )
    assert "95 % interval" in out
    assert "what matters most is" in out
    assert "correlation_thrust" in out
    value = json.loads(results(capsys, "show", str(good), "--facet", str(facet), "--json", "-q")[0])
    assert value["cases"][0]["correlation"]["thrust"] == pytest.approx(
        rows["driver_correlation"][facet]
        if rows["driver"][facet] == 14
        else value["cases"][0]["correlation"]["thrust"]
    )
    always = int(np.flatnonzero(rows["reachable"] == SAMPLES)[0])
    out, _ = results(capsys, "show", str(good), "--facet", str(always), "--case", "high_700s")
    assert "the verdict is the same in every sample" in out
    _, err = results(capsys, "show", str(good), "--facet", "80", code=ExitCode.REFUSED)
    assert "no such facet; take one of 0 to 79" in err


def test_tables_go_out_as_csv_and_json(
    good: Path, run: DispersionRun, capsys: pytest.CaptureFixture[str]
) -> None:
    text, _ = results(capsys, "export", str(good), "--case", "high_600s")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(rows) == FACETS
    assert [float(row["probability"]) for row in rows] == run.cases[1].facets["probability"].tolist()
    text, _ = results(capsys, "export", str(good), "--table", "samples", "--format", "json")
    samples = json.loads(text)
    assert len(samples) == 2 * SAMPLES
    assert list(samples[0])[:3] == ["case", "sample", "position_m_x"]
    text, _ = results(capsys, "export", str(good), "--table", "summary")
    assert len(text.splitlines()) == 3
    for wrong in ("boundary", "trajectory"):
        _, err = results(capsys, "export", str(good), "--table", wrong, code=ExitCode.USAGE)
        assert "its tables are facets, samples, summary" in err


def test_maps_carry_the_probability(
    good: Path, run: DispersionRun, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = ("export", str(good), "--case", "high_700s", "--format")
    text, _ = results(capsys, *one, "vtp")
    assert 'Name="probability_low"' in text
    text, _ = results(capsys, *one, "obj")
    assert "g probability_0.9_to_1.0" in text
    assert len([line for line in text.splitlines() if line.startswith("f ")]) == FACETS
    results(capsys, *one, "ply", "-o", str(tmp_path / "m.ply"))
    head, _, body = (tmp_path / "m.ply").read_bytes().partition(b"end_header\n")
    assert b"property double probability" in head
    width = len(body[24 * 42 :]) // FACETS
    colours = np.frombuffer(body[24 * 42 :], dtype=np.uint8).reshape(FACETS, width)[:, 13:16]
    always = run.cases[0].facets["probability"] == 1.0
    assert (colours[always] == (0, 114, 178)).all()
    assert (colours[run.cases[0].facets["probability"] == 0.0] == (213, 94, 0)).all()
    _, err = results(capsys, "export", str(good), "--format", "vtp", code=ExitCode.REFUSED)
    assert "a map shows one case" in err


def test_figures_are_drawn_and_the_running_interval_ends_at_the_stored_one(
    good: Path, run: DispersionRun, tmp_path: Path
) -> None:
    first = replace(run, cases=run.cases[:1])
    written = [path.name for path in write_figures(first, tmp_path / "run")]
    assert written == [f"run-high_700s-{name}.png" for name in ("probability", "area", "convergence")]
    (one,) = write_figures(run, tmp_path / "run", "high_600s", 3)
    assert one.name == "run-high_600s-facet3-convergence.png"
    assert one.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(InputRefused, match="add --case"):
        list(write_figures(run, tmp_path / "run", None, 3))
    for facet in (0, 40):
        mean, low, high = running_interval(run.cases[0], facet, np.array([1, 5, SAMPLES]))
        row = run.cases[0].facets[facet]
        ends = [row["probability"], row["probability_low"], row["probability_high"]]
        assert_allclose([mean[-1], low[-1], high[-1]], ends, rtol=1e-12)
        assert (np.diff(high - low) < 0.0).all()


def test_runs_are_compared(good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    solve_boulder(tmp_path, "disperse.cases=[high_700s]", "spacecraft.thrust_max_n=24")
    value = json.loads(results(capsys, "diff", str(good), str(tmp_path / "run.h5"), "--json")[0])
    (case,) = value["cases"]
    assert (case["case"], case["less_sure"], value["equal"]) == ("high_700s", 0, False)
    assert case["surer"] > 0
    assert case["area_change_m2"] > 0.0
    value = json.loads(results(capsys, "diff", str(good), str(good), "--json")[0])
    assert value["equal"] is True
    assert value["cases"][0]["probability_change_max"] == 0.0


def test_columns_have_units_and_meanings_for_other_readers(good: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    with xarray.open_dataset(good, group="cases/high_700s", engine="h5netcdf") as case:
        assert case["verdicts"].dims == ("sample", "facet")
        assert case["verdicts"].attrs["flag_meanings"] == "unresolved reachable unreachable"
    with xarray.open_dataset(good, group="cases/high_700s/samples", engine="h5netcdf") as samples:
        assert samples["position_m"].attrs["units"] == "m"
    assert isinstance(read(good).tree.group("drawing").dataset("state_factor"), Dataset)

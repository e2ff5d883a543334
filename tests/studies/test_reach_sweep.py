"""reach sweep, solved: every cell is what reach run finds, whoever solves it and however it is stopped."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenario_samples import MINIMAL

from landing_cli.cli.app import main
from landing_cli.errors import ExitCode, InputRefused
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import run_from_result as reach_from_result
from landing_cli.results.journal import read_journal
from landing_cli.results.output import journal_path
from landing_cli.results.store import read, write
from landing_cli.results.tree import Dataset, Group
from landing_cli.studies.sweep.records import CELL_COLUMNS, SweepRun, kept_columns
from landing_cli.studies.sweep.stored import run_from_result

SCENARIO = (
    MINIMAL.replace("octahedron.obj", "rock.obj")
    .replace("{model: point_mass, density_kg_m3: 2000}", "{model: harmonics, gm_m3_s2: 4.9}")
    .replace("900]}", "900]}\n    - {name: side, position_m: [850, 100, 0], velocity_m_s: [0, 0.05, 0]}")
    .replace("[700, 900]", "700")
)
OVER = (
    "--over=reach.tof_s=650:750:50",
    "--over=reach.handover=outside,on_ellipsoid",
    "--over=body.gravity.gm_m3_s2=4.9,6.5",
)
CELLS, STATES, FACETS = 12, 2, 80


def write_rock(folder: Path, subdivisions: int = 1) -> Path:
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions)
    vertices = np.asarray(sphere.vertices) * (280.0, 260.0, 240.0)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(sphere.faces) + 1).tolist()]
    (folder / "rock.obj").write_text("\n".join(lines) + "\n")
    (folder / "probe.yaml").write_text(SCENARIO)
    return folder / "probe.yaml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A scenario, and its sweep under grid.h5."""
    home, there = Path.cwd(), tmp_path_factory.mktemp("sweep")
    os.chdir(there)
    write_rock(there)
    assert main("reach", ["sweep", "probe.yaml", *OVER, "-o", "grid.h5", "-q", "--jobs", "1"]) == 0
    yield there
    os.chdir(home)


@pytest.fixture(scope="module")
def run(folder: Path) -> SweepRun:
    return run_from_result(read(folder / "grid.h5"))


def test_every_cell_is_what_reach_run_finds_bit_for_bit(folder: Path, run: SweepRun) -> None:
    assert len(run.cases) == CELLS * STATES
    for cell in (0, 4, 7, 11):
        tof_s, handover, gm = (str(text) for text in run.grid.question.texts_at(cell).values())
        values = (f"reach.tof_s={tof_s}", f"reach.handover={handover}", f"body.gravity.gm_m3_s2={gm}")
        put = [argument for value in values for argument in ("--set", value)]
        assert main("reach", ["run", "probe.yaml", *put, "-o", f"cell{cell}.h5", "-q"]) == 0
        alone = reach_from_result(read(folder / f"cell{cell}.h5"))
        for state, result in enumerate(alone.cases):
            found = run.cases[cell * STATES + state]
            assert (found.initial_state, found.at["tof_s"]) == (result.initial_state, result.case.tof_s)
            for name, values_alone in kept_columns(result.solutions).items():
                np.testing.assert_array_equal(found.columns[name], values_alone, err_msg=name)
                assert found.columns[name].tobytes() == values_alone.tobytes()
            shared = {key: found.summary[key] for key in result.summary}
            assert shared == dict(result.summary)


def test_cells_differ_where_the_questions_do(run: SweepRun) -> None:
    counts = {case.name: case.summary["reachable"] for case in run.cases}
    assert min(counts.values()) < max(counts.values()) < FACETS
    stronger = [case.columns["performance_index_m2_s3"] for case in run.cases[:: 2 * STATES]]
    assert len({values.tobytes() for values in stronger}) == len(stronger)
    gravities = [run.cases[i * STATES].columns["delta_v_m_s"] for i in (0, 1)]
    assert not np.array_equal(*gravities, equal_nan=True)


def test_xarray_reads_the_grid_with_its_axes(folder: Path, run: SweepRun) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    with xarray.open_dataset(folder / "grid.h5", group="grid", engine="h5netcdf") as grid:
        assert grid["verdict"].dims == ("tof_s", "handover", "gm_m3_s2", "initial_state", "facet")
        assert grid["verdict"].dtype == np.uint8
        assert grid["reachable_area_m2"].dims == ("tof_s", "handover", "gm_m3_s2", "initial_state")
        np.testing.assert_array_equal(grid["tof_s"], [650.0, 700.0, 750.0])
        assert grid["tof_s"].attrs["units"] == "s"
        assert [str(value) for value in grid["initial_state"].values] == ["top", "side"]
        cell = grid.sel(tof_s=700, handover="on_ellipsoid", gm_m3_s2=6.5, initial_state="side")
        (case,) = [c for c in run.cases if c.name == "side,tof_s=700,handover=on_ellipsoid,gm_m3_s2=6.5"]
        assert int((cell["verdict"] == Verdict.REACHABLE).sum()) == case.summary["reachable"]
        assert float(cell["delta_v_median_m_s"]) == case.summary["delta_v_m_s"]["median"]


@pytest.mark.parametrize("way", ["--jobs=2", "--jobs=2 --backend=loky"])
def test_jobs_and_backends_change_nothing(way: str, folder: Path) -> None:
    path = folder / f"{len(way)}.h5"
    assert main("reach", ["sweep", "probe.yaml", *OVER, "-o", str(path), "-q", *way.split()]) == 0
    assert read(path).digest == read(folder / "grid.h5").digest


def test_a_killed_sweep_resumes_to_the_undisturbed_result(folder: Path) -> None:
    path = folder / "killed.h5"
    arguments = ["sweep", "probe.yaml", *OVER, "-o", str(path), "-q", "--jobs", "1"]
    program = "import sys; from landing_cli.cli.app import reach; sys.argv[0] = 'reach'; reach()"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, "-c", program, *arguments], env=environment)
    for _ in range(6000):
        content = read_journal(journal_path(path)) if journal_path(path).exists() else None
        if process.poll() is not None or (content is not None and len(content.records) >= 2):
            break
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not path.exists(), "it was not killed in time"
    content = read_journal(journal_path(path))
    assert content is not None
    assert len(content.records) >= 2
    assert main("reach", arguments) == ExitCode.REFUSED
    assert main("reach", [*arguments, "--resume"]) == 0
    assert read(path).digest == read(folder / "grid.h5").digest
    assert not journal_path(path).exists()


def test_the_same_sweep_is_up_to_date_and_another_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    same = ["--over=reach.tof_s=650,700,750", *OVER[1:]]
    assert main("reach", ["sweep", "probe.yaml", *same, "-o", "grid.h5"]) == 0
    assert "is up to date" in capsys.readouterr().err
    other = ["--over=reach.tof_s=650,700,740", *OVER[1:]]
    assert main("reach", ["sweep", "probe.yaml", *other, "-o", "grid.h5"]) == ExitCode.REFUSED
    assert "--over reach.tof_s=650,700,740" in capsys.readouterr().err


def test_show_and_json_tell_every_cell(
    folder: Path, run: SweepRun, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main("landing", ["results", "show", "grid.h5", "-q"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[:5] == ["tof_s", "handover", "gm_m3_s2", "initial_state", "reachable"]
    assert len(lines) == 1 + CELLS * STATES
    assert main("landing", ["results", "show", "grid.h5", "-q", "--json", "--case", "side,tof_s=650"]) == 0
    value = json.loads(capsys.readouterr().out)
    assert [axis["key"] for axis in value["axes"]] == [
        "reach.tof_s",
        "reach.handover",
        "body.gravity.gm_m3_s2",
    ]
    assert len(value["cases"]) == 4
    assert value["cases"][0]["at"] == {"tof_s": 650.0, "handover": "outside", "gm_m3_s2": 4.9}
    assert value["cases"][0]["reachable"] == run.cases[1].summary["reachable"]


def test_show_tells_for_which_cells_a_facet_is_reachable(
    folder: Path, run: SweepRun, capsys: pytest.CaptureFixture[str]
) -> None:
    reached = np.array([case.columns["verdict"] == Verdict.REACHABLE for case in run.cases]).sum(axis=0)
    facet = int(np.argmin(np.abs(reached - CELLS * STATES // 2)))
    assert main("landing", ["results", "show", "grid.h5", "-q", "--facet", str(facet)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"facet {facet} is reachable in {reached[facet]} of {CELLS * STATES} cases"
    assert lines[1].split() == ["initial_state", "handover", "gm_m3_s2", "reachable_at_tof_s"]
    assert len(lines) == 2 + 4 * STATES
    assert main("landing", ["results", "show", "grid.h5", "-q", "--facet", str(facet), "--json"]) == 0
    cases = json.loads(capsys.readouterr().out)["cases"]
    assert sum(case["verdict"] == "reachable" for case in cases) == reached[facet]
    assert main("landing", ["results", "show", "grid.h5", "--facet", "80"]) == ExitCode.REFUSED
    assert "take one of 0 to 79" in capsys.readouterr().err


def exported(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main("landing", ["results", "export", "grid.h5", *arguments]) == 0
    return capsys.readouterr().out


def test_tables_hold_a_row_a_cell_and_a_row_a_facet(
    folder: Path, run: SweepRun, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = list(csv.DictReader(io.StringIO(exported(capsys))))
    assert len(rows) == CELLS * STATES
    assert rows[5]["case"] == run.cases[5].name
    assert float(rows[5]["reachable_area_m2"]) == run.cases[5].summary["reachable_area_m2"]
    rows = list(csv.DictReader(io.StringIO(exported(capsys, "--table", "facets"))))
    assert len(rows) == CELLS * STATES * FACETS
    case, facet = divmod(777, FACETS)
    assert float(rows[777]["tof_s"]) == run.cases[case].at["tof_s"]
    assert rows[777]["handover"] == run.cases[case].at["handover"]
    assert int(rows[777]["facet"]) == facet
    assert rows[777]["verdict"] == Verdict(int(run.cases[case].columns["verdict"][facet])).name.lower()
    few = json.loads(exported(capsys, "--table=facets", "--format=json", f"--case={run.cases[3].name}"))
    assert len(few) == FACETS


def test_maps_and_figures_are_written(folder: Path, run: SweepRun) -> None:
    share = ["results", "export", "grid.h5", "--format", "vtp", "-o", "share.vtp"]
    assert main("landing", share) == 0
    assert b'Name="reachable_share"' in (folder / "share.vtp").read_bytes()
    one = [*share[:-1], "one.vtp", "--case", run.cases[0].name]
    assert main("landing", one) == 0
    assert b'Name="delta_v_m_s"' in (folder / "one.vtp").read_bytes()
    names = {
        (): {f"grid-{what}-{s}.png" for what in ("area", "delta-v") for s in ("top", "side")}
        | {"grid-share.png"},
        ("--facet", "3"): {"grid-facet3-top.png", "grid-facet3-side.png"},
        ("--case", run.cases[0].name): {
            f"grid-{run.cases[0].name}-{what}.png" for what in ("verdict", "delta-v")
        },
    }
    for place, (arguments, wanted) in enumerate(names.items()):
        assert main("landing", ["results", "plot", "grid.h5", "-q", "-o", f"f{place}", *arguments]) == 0
        assert {path.name for path in (folder / f"f{place}").iterdir()} == wanted


@pytest.mark.parametrize("axes", [1, 2])
def test_few_axes_are_curves_or_heat_maps(axes: int, folder: Path) -> None:
    name = f"few{axes}"
    assert main("reach", ["sweep", "probe.yaml", *OVER[:axes], "-o", f"{name}.h5", "-q"]) == 0
    assert main("landing", ["results", "plot", f"{name}.h5", "-q", "-o", name]) == 0
    found = {path.name for path in (folder / name).iterdir()}
    assert found == {f"{name}-area.png", f"{name}-delta-v.png", f"{name}-share.png"}


def test_verify_solves_and_flies_cells_again(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main("landing", ["results", "verify", "grid.h5", "--case", "top,tof_s=750", "-q", "--json"]) == 0
    value = json.loads(capsys.readouterr().out)
    assert value["verified"]
    assert len(value["cases"]) == 4
    for case in value["cases"]:
        assert case["faults"] == []
        assert case["worst"]["again_performance_index_m2_s3"]["value"] == 0.0
        assert case["flown"] > 0


def forged(folder: Path, name: str, column: str, change: float) -> Path:
    """Change one reachable facet's number by a share, or the first summary's."""
    result = read(folder / "grid.h5")
    grid = dict(result.tree.group("grid").members)
    dataset = grid[column]
    assert isinstance(dataset, Dataset)
    data = dataset.data.copy()
    place = np.flatnonzero(np.isfinite(data.reshape(-1)))[0]
    if data.dtype.kind == "u":
        data.reshape(-1)[place] ^= 1
    else:
        data.reshape(-1)[place] *= 1.0 + change
    grid[column] = Dataset(data, dataset.units, dataset.description, dataset.dims, dataset.flags)
    tree = Group({**result.tree.members, "grid": Group(grid)}, result.tree.attributes)
    attributes = {"mission": "sweep", "complete": 1, **result.identity.as_dict()}
    write(folder / name, tree, attributes, {})
    return folder / name


def test_a_number_that_no_solve_gives_fails_the_verification(
    folder: Path, run: SweepRun, capsys: pytest.CaptureFixture[str]
) -> None:
    reachable = run.cases[0].columns["verdict"] == Verdict.REACHABLE
    values = run.cases[0].columns["delta_v_m_s"][reachable]
    first = float(values[0])
    assert first not in (values.min(), values.max(), np.median(values)), "take another facet"
    forged(folder, "forged.h5", "delta_v_m_s", 1e-5)
    command = ["results", "verify", "forged.h5", "-q", "--case", run.cases[0].name]
    assert main("landing", command) == ExitCode.VERIFICATION_FAILED
    assert "again_delta_v_m_s 1e-05, at most 1e-06 is allowed" in capsys.readouterr().err
    forged(folder, "forged.h5", "binding", 0.0)
    assert main("landing", command) == ExitCode.VERIFICATION_FAILED
    assert "facet 0 has another binding when it is solved again" in capsys.readouterr().err


@pytest.mark.parametrize("column", ["reachable_area_m2", "tof_s", "delta_v_max_m_s"])
def test_what_does_not_follow_from_the_facets_is_refused(column: str, folder: Path) -> None:
    path = forged(folder, f"forged-{column}.h5", column, 1e-3)
    with pytest.raises(InputRefused, match=f"grid/{column} does not follow"):
        run_from_result(read(path))


def test_diff_compares_sweeps_cell_by_cell(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = ["--over=reach.tof_s=650,700", *OVER[1:], "--set", "spacecraft.thrust_max_n=9.5"]
    assert main("reach", ["sweep", "probe.yaml", *other, "-o", "weak.h5", "-q"]) == 0
    capsys.readouterr()
    assert main("landing", ["results", "diff", "grid.h5", "weak.h5", "--json", "-q"]) == 0
    cases = json.loads(capsys.readouterr().out)["cases"]
    assert len(cases) == 8 * STATES
    assert sum(case["lost"] for case in cases) > 0
    assert sum(case["gained"] for case in cases) == 0


def test_columns_that_are_kept_are_those_of_reach() -> None:
    assert [column.name for column in CELL_COLUMNS] == [
        "verdict",
        "proved",
        "performance_index_m2_s3",
        "delta_v_m_s",
        "binding",
        "cuts_rock",
    ]

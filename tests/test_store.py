"""A result file is written whole, read back bit for bit, and believed only when it is intact."""

from __future__ import annotations

import dataclasses
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.mesh import Mesh
from landing_cli.errors import InputRefused, OutputRefused
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.records import FacetSolutions, LandingCase, Verdict, blank_rows
from landing_cli.reach.stored import CaseResult, ReachRun, run_from_result, run_to_tree
from landing_cli.reach.summary import summarise
from landing_cli.results.identity import RunIdentity
from landing_cli.results.output import OutputState, finish_output, inspect_output, journal_path, open_output
from landing_cli.results.store import read, write
from landing_cli.results.store.files import _SEAL_BYTES, _seal
from landing_cli.results.tree import Dataset, Group, digest

IDENTITY = RunIdentity("reach run", "name: cube\ntof_s: 700  # s\n", "a" * 64, "0.1.0", 1, 64)
ROOT = {"mission": "reach", **IDENTITY.as_dict(), "complete": 1}
PROVENANCE = {"command_line": "reach run cube", "cpu_s": 1.5}


def make_run(facets: int = 12, seed: int = 0) -> ReachRun:
    rng = np.random.default_rng(seed)
    vertices = rng.normal(size=(8, 3))
    faces = np.array([[i % 8, (i + 1) % 8, (i + 2) % 8] for i in range(facets)])
    gravity = GravityField(GravityKind.DIPOLE, np.array([2.4, 50.0, 0.0, 2.492, -50.0, 0.0]))
    body = Asteroid("cube", Mesh(vertices, faces), 4.07e-4, gravity, 4.892)
    cases = []
    for order, tof in enumerate((900.0, 700.0)):
        rows = blank_rows(np.arange(facets))
        rows["verdict"] = rng.choice(list(Verdict), size=facets)
        rows["performance_index_m2_s3"][::2] = rng.normal(size=facets // 2)
        rows["costates"] = rng.normal(size=(facets, 7))
        rows["thrust_nodes"] = rng.integers(0, 5, size=facets)
        nodes = rng.normal(size=(rows["thrust_nodes"].sum(), 3))
        case = LandingCase(
            f"pole_{tof:g}s",
            body,
            Spacecraft(2000.0, 20.0, 400.0),
            np.array([0.0, 0.0, 800.0]),
            np.zeros(3),
            tof,
            200.0,
            np.array([290.0, 280.0, 266.0]),
            np.radians(60.0),
        )
        section = Group({"facet": Dataset(np.arange(3), "1", "facets of the section", ("point",))}, {"N": 3})
        solutions = FacetSolutions(rows, nodes)
        summary = {**summarise(body.mesh, solutions), "delta_v_m_s": {"min": 1.5, "median": None, "max": 2.5}}
        lost = {3: "its worker process died of SIGSEGV"} if order else {}
        cases.append(CaseResult(case, "pole", solutions, summary, section if order else None, lost))
    return ReachRun(tuple(cases))


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    path = tmp_path / "run.h5"
    write(path, run_to_tree(make_run()), ROOT, PROVENANCE)
    return path


def test_a_run_comes_back_equal_in_every_number(stored: Path) -> None:
    before, after = make_run(), run_from_result(read(stored))
    assert digest(run_to_tree(before)) == digest(run_to_tree(after))
    for a, b in zip(before.cases, after.cases, strict=True):
        assert a.case.name == b.case.name
        assert a.solutions.rows.tobytes() == b.solutions.rows.tobytes()
        assert a.solutions.thrust_nodes_n.tobytes() == b.solutions.thrust_nodes_n.tobytes()
        assert a.summary == b.summary
        assert a.lost == b.lost
        assert dataclasses.asdict(a.case.spacecraft) == dataclasses.asdict(b.case.spacecraft)
        np.testing.assert_array_equal(a.case.ellipsoid_m, b.case.ellipsoid_m)
        assert (a.case.tof_s, a.case.handover) == (b.case.tof_s, b.case.handover)
    np.testing.assert_array_equal(before.asteroid.gravity.params, after.asteroid.gravity.params)
    offsets = read(stored).tree.group("cases", "pole_700s", "trajectories").dataset("node_offsets").data
    np.testing.assert_array_equal(offsets, before.cases[1].solutions.node_offsets)
    assert after.asteroid.gravity.kind is GravityKind.DIPOLE
    assert after.lost_facets == 1


def test_the_same_run_makes_the_same_bytes_and_provenance_stays_out_of_the_digest(stored: Path) -> None:
    first, fingerprint = stored.read_bytes(), read(stored).digest
    assert write(stored, run_to_tree(make_run()), ROOT, PROVENANCE) == fingerprint
    assert stored.read_bytes() == first
    assert write(stored, run_to_tree(make_run()), ROOT, {**PROVENANCE, "cpu_s": 2.0}) == fingerprint
    assert stored.read_bytes() != first
    assert read(stored).provenance["cpu_s"] == 2.0
    assert write(stored, run_to_tree(make_run(seed=1)), ROOT, PROVENANCE) != fingerprint


def test_the_bytes_reach_the_disk_before_the_name_does(stored: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []
    for place, name in ((os, "write"), (os, "fsync"), (Path, "replace")):
        real = getattr(place, name)
        monkeypatch.setattr(place, name, lambda *a, real=real, name=name: (calls.append(name), real(*a))[1])
    write(stored, run_to_tree(make_run()), ROOT, PROVENANCE)
    assert [c for i, c in enumerate(calls) if i == 0 or calls[i - 1] != c] == [
        "write",
        "fsync",
        "replace",
        "fsync",
    ]


def test_every_array_has_a_checksum_a_unit_a_description_and_named_dimensions(stored: Path) -> None:
    found = []

    def check(name: str, item: h5py.HLObject) -> None:
        if isinstance(item, h5py.Dataset) and not item.is_scale:
            found.append(name)
            assert item.fletcher32, name
            assert item.attrs["units"], name
            assert item.attrs["description"], name
            for dim in item.dims:
                assert len(dim) == 1, f"{name} has no scale"
                assert dim[0].shape == (item.shape[list(item.dims).index(dim)],)

    with h5py.File(stored) as file:
        file.visititems(check)
        verdict = file["cases/pole_700s/facets/verdict"]
        assert verdict.attrs["flag_meanings"] == "unresolved reachable unreachable"
        assert verdict.attrs["flag_values"].tolist() == [0, 1, 2]
        assert verdict.dims[0][0].name == "/cases/pole_700s/facets/facet"
        assert file.attrs["mission"] == "reach"
        assert file.attrs["scenario"] == IDENTITY.scenario
    assert len(found) > 40


def test_xarray_reads_it_with_dimensions_and_units(stored: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    with xarray.open_dataset(stored, group="cases/pole_700s/facets", engine="h5netcdf") as facets:
        assert facets["costates"].dims == ("facet", "costate")
        assert facets["fuel_kg"].attrs["units"] == "kg"
        np.testing.assert_array_equal(facets["facet"], np.arange(12))
    with xarray.open_dataset(stored, group="body", engine="h5netcdf") as body:
        assert body["vertices"].dims == ("vertex", "xyz")


FLIPS = """
import sys
import numpy as np
from pathlib import Path
from landing_cli.errors import InputRefused
from landing_cli.results.store import read
path = Path(sys.argv[1])
good = read(path).digest
whole = bytearray(path.read_bytes())
rng = np.random.default_rng(0)
refused = 0
for place in rng.integers(len(whole) * 8, size=2000).tolist():
    whole[place // 8] ^= 1 << place % 8
    path.write_bytes(whole)
    whole[place // 8] ^= 1 << place % 8
    try:
        read(path)
    except InputRefused:
        refused += 1
print(refused)
"""


def test_each_of_2000_flipped_bits_is_refused_and_none_crashes(stored: Path) -> None:
    done = subprocess.run([sys.executable, "-c", FLIPS, stored], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, "2000"), done.stderr


def test_a_file_cut_anywhere_is_refused(stored: Path) -> None:
    whole = stored.read_bytes()
    for cut in [0, 1, 7, 8, 100, 5000, len(whole) - 200, len(whole) - 1]:
        stored.write_bytes(whole[:cut])
        with pytest.raises(InputRefused):
            read(stored)


def resealed(path: Path, change: Callable[[h5py.File], None]) -> None:
    """Change a result as a forger would: with a fresh seal."""
    path.write_bytes(path.read_bytes()[:-_SEAL_BYTES])
    with h5py.File(path, "r+") as file:
        change(file)
    image = path.read_bytes()
    path.write_bytes(image + _seal(image))


def _external_link(file: h5py.File) -> None:
    file["cases/elsewhere"] = h5py.ExternalLink("/etc/passwd", "/")


def _soft_link(file: h5py.File) -> None:
    file["cases/again"] = h5py.SoftLink("/cases")


def _circle(file: h5py.File) -> None:
    file["cases/circle"] = file["cases"]


def _external_storage(file: h5py.File) -> None:
    file.create_dataset("stolen", (10,), "u1", external=[("/etc/passwd", 0, 10)])


def _virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((10,), "f8")
    layout[:] = h5py.VirtualSource("/tmp/other.h5", "x", (10,))
    file.create_virtual_dataset("virtual", layout)


def _giant(file: h5py.File) -> None:
    file.create_dataset("giant", (10**12,), "f8", chunks=(1024,), fletcher32=True)


def _compressed(file: h5py.File) -> None:
    file.create_dataset("bomb", data=np.zeros(10**6), compression="gzip", fletcher32=True)


def _no_checksum(file: h5py.File) -> None:
    file.create_dataset("bare", data=np.zeros(10))


def _other_type(file: h5py.File) -> None:
    file.create_dataset("bits", data=np.array([True]), chunks=(1,), fletcher32=True)


def _named_type(file: h5py.File) -> None:
    file["type"] = np.dtype("f8")


def _deep(file: h5py.File) -> None:
    file.create_group("/".join("x" * 40))


def _reference(file: h5py.File) -> None:
    file.attrs["where"] = file["cases"].ref


def _schema(file: h5py.File) -> None:
    file.attrs["schema_version"] = 99


def _number(file: h5py.File) -> None:
    file["cases/pole_700s/facets/fuel_kg"][0] = 1.0


def _attribute(file: h5py.File) -> None:
    file["cases/pole_700s"].attrs["tof_s"] = 701.0


def _no_digest(file: h5py.File) -> None:
    del file.attrs["digest_sha256"]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (_external_link, "link"),
        (_soft_link, "link"),
        (_circle, "linked twice"),
        (_external_storage, "another file"),
        (_virtual, "another file"),
        (_giant, "does not fit"),
        (_compressed, "other filters"),
        (_no_checksum, "no checksum"),
        (_other_type, "holds bool"),
        (_named_type, "neither group nor dataset"),
        (_deep, "deep"),
        (_reference, "unknown kind"),
        (_schema, "schema version 99"),
        (_number, "digest"),
        (_attribute, "digest"),
        (_no_digest, "digest"),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_a_forged_file_is_refused_by_name(
    stored: Path, change: Callable[[h5py.File], None], told: str
) -> None:
    resealed(stored, change)
    with pytest.raises(InputRefused, match=told):
        read(stored)


def test_what_is_no_result_is_refused_at_once(tmp_path: Path) -> None:
    fifo, folder, text, other = (tmp_path / name for name in ("fifo", "folder", "text", "other.h5"))
    os.mkfifo(fifo)
    folder.mkdir()
    text.write_text("facet,verdict\n")
    with h5py.File(other, "w") as file:
        file["x"] = [1.0]
    for path, told in [(fifo, "pipe"), (folder, "directory"), (text, "no HDF5"), (other, "no seal")]:
        with pytest.raises(InputRefused, match=told):
            read(path)
    with pytest.raises(InputRefused, match="No such file"):
        read(tmp_path / "absent.h5")


def test_a_giant_file_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "giant.h5"
    path.touch()
    os.truncate(path, 1 << 40)
    with pytest.raises(InputRefused, match="MiB"):
        read(path)


def test_gigabytes_of_something_else_are_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from landing_cli.results.store import files

    path = tmp_path / "zeros.h5"
    path.touch()
    os.truncate(path, 3 << 30)
    monkeypatch.setattr(files, "read_whole", lambda _: pytest.fail("was read"))
    with pytest.raises(InputRefused, match="no HDF5"):
        read(path)
    assert inspect_output(path, IDENTITY).state is OutputState.FOREIGN


def test_a_result_of_another_mission_is_not_taken_for_a_reach_run(tmp_path: Path) -> None:
    path = tmp_path / "plan.h5"
    write(path, Group(), {**ROOT, "mission": "plan"}, {})
    with pytest.raises(InputRefused, match="'plan'"):
        run_from_result(read(path))
    write(path, Group({"body": Group()}), ROOT, {})
    with pytest.raises(InputRefused, match="lacks a part"):
        run_from_result(read(path))


def test_text_and_empty_arrays_survive(tmp_path: Path) -> None:
    members = {
        "names": Dataset(np.array(["Größe", "", "x"]), "1", "names", ("name",)),
        "nothing": Dataset(np.zeros((0, 3)), "m", "no points", ("point", "xyz")),
        "large": Dataset(np.arange(400_000.0), "m", "several chunks", ("row",)),
    }
    tree = Group(members, {"texts": ("a", "ü"), "list": np.array([1, 2]), "flag": True})
    path = tmp_path / "x.h5"
    write(path, tree, {}, {})
    back = read(path).tree
    assert back.dataset("names").data.tolist() == ["Größe", "", "x"]
    assert back.dataset("nothing").data.shape == (0, 3)
    np.testing.assert_array_equal(back.dataset("large").data, np.arange(400_000.0))
    assert back.attributes["texts"] == ("a", "ü")
    assert back.attributes["flag"] == 1


def finished(path: Path, complete: bool = True) -> None:
    journal = open_output(path, IDENTITY, resume=True)
    assert journal is not None
    journal.append("x", {"a": np.zeros(3)})
    finish_output(journal, run_to_tree(make_run()), {}, PROVENANCE, complete=complete)


def test_a_complete_result_of_the_same_run_is_up_to_date(tmp_path: Path) -> None:
    path = tmp_path / "new" / "run.h5"
    assert inspect_output(path, IDENTITY).state is OutputState.ABSENT
    finished(path)
    assert [p.name for p in path.parent.iterdir()] == ["run.h5"]
    assert open_output(path, IDENTITY) is None
    assert open_output(path, IDENTITY, resume=True) is None
    again = dataclasses.replace(IDENTITY, scenario=IDENTITY.scenario.replace("# s", "# seconds"))
    assert open_output(path, again) is None  # a comment changes no number


def test_a_result_with_lost_facets_is_unfinished_and_keeps_its_journal(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    finished(path, complete=False)
    assert inspect_output(path, IDENTITY).state is OutputState.UNFINISHED_SAME
    with pytest.raises(OutputRefused, match="--resume"):
        open_output(path, IDENTITY)
    journal = open_output(path, IDENTITY, resume=True)
    assert journal is not None
    assert list(journal.records) == ["x"]
    finish_output(journal, run_to_tree(make_run()), {}, PROVENANCE, complete=True)
    assert open_output(path, IDENTITY) is None


def test_a_different_result_is_refused_with_what_changed_until_forced(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    finished(path)
    before = path.read_bytes()
    other = dataclasses.replace(IDENTITY, scenario="name: cube\ntof_s: 900\n", package_version="0.2.0")
    for choices in ({}, {"resume": True}):
        with pytest.raises(OutputRefused, match=r"tof_s: 700 -> tof_s: 900; package version: 0.1.0 -> 0.2.0"):
            open_output(path, other, **choices)
    journal = open_output(path, other, force=True)
    assert journal is not None
    journal.close()
    assert path.read_bytes() == before  # replaced by the new result only
    assert not journal_path(path).exists()


def test_a_file_that_we_did_not_write_is_never_replaced(tmp_path: Path) -> None:
    path = tmp_path / "thesis.h5"
    path.write_text("years of work")
    for choices in ({}, {"resume": True}, {"force": True}):
        with pytest.raises(OutputRefused, match="did not write"):
            open_output(path, IDENTITY, **choices)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.h5"]


def test_a_damaged_result_may_be_replaced_by_force(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    finished(path)
    damaged = bytearray(path.read_bytes())
    damaged[3000] ^= 1
    path.write_bytes(damaged)
    with pytest.raises(OutputRefused, match=r"seal does not fit.*--force"):
        open_output(path, IDENTITY)
    journal = open_output(path, IDENTITY, force=True)
    assert journal is not None
    journal.close()


def test_a_journal_left_by_a_kill_after_the_result_was_stored_is_swept_away(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    finished(path, complete=False)
    left = journal_path(path).read_bytes()
    journal_path(path).unlink()
    finished(path)
    journal_path(path).write_bytes(left)
    assert open_output(path, IDENTITY) is None
    assert not journal_path(path).exists()


def test_a_disk_too_full_for_the_result_keeps_the_journal_and_leaves_no_temporary(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    journal = open_output(path, IDENTITY)
    assert journal is not None
    journal.append("x", {"a": np.zeros(3)})
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (5000, hard))
    try:
        with journal, pytest.raises(OutputRefused, match="--resume"):
            finish_output(journal, run_to_tree(make_run()), {}, PROVENANCE, complete=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [p.name for p in tmp_path.iterdir()] == ["run.h5.journal"]
    finished(path)
    assert open_output(path, IDENTITY) is None


def test_units_and_dimensions_must_fit(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="dimensions"):
        Dataset(np.zeros((2, 3)), "m", "x", ("a",))
    with pytest.raises(TypeError, match="object"):
        Dataset(np.array([{}]), "m", "x", ("a",))
    clash = {"a": Dataset(np.zeros(2), "m", "", ("n",)), "b": Dataset(np.zeros(3), "m", "", ("n",))}
    with pytest.raises(ValueError, match="dimension n is 2 and 3"):
        write(tmp_path / "x.h5", Group(clash), {}, {})

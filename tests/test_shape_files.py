"""The readers take what they should, refuse the rest by name, and never do more than read one file."""

from __future__ import annotations

import hashlib
import os
import resource
import socket
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings, strategies as st
from shape_helpers import fibonacci_ellipsoid

from landing_cli.body.mesh import Mesh
from landing_cli.errors import InputRefused, OutputRefused
from landing_cli.sources import shape_lines
from landing_cli.sources.shape_files import obj_text, read_mesh, read_raw, read_shape, rounded, write_obj

BODY = rounded(fibonacci_ellipsoid((300.0, 200.0, 150.0), 40))
V, F = BODY.vertices, BODY.faces
XYZ = [f"{x / 1e3:.6f} {y / 1e3:.6f} {z / 1e3:.6f}" for x, y, z in V.tolist()]


def abc(base: int) -> list[str]:
    return [f"{a} {b} {c}" for a, b, c in (F + base).tolist()]


def numbered(rows: list[str], start: int) -> list[str]:
    return [f"{i} {row}" for i, row in enumerate(rows, start)]


def records(base: int = 1) -> list[str]:
    return [f"v {row}" for row in XYZ] + [f"f {row}" for row in abc(base)]


def put(folder: Path, text: str | bytes, name: str = "shape.tab") -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def same_body(mesh: Mesh) -> None:
    np.testing.assert_array_equal(mesh.faces, F)
    np.testing.assert_allclose(mesh.vertices, V, rtol=0, atol=1e-9)


DIALECTS = {
    "v/f records": records(),
    "v/f records counting from 0": records(0),
    "v/f records behind two counts": ["40 76", *records()],
    "v/f records behind one count": ["40", *records()],
    "plain rows": [*XYZ, *abc(1)],
    "plain rows counting from 0": [*XYZ, *abc(0)],
    "plain rows behind two counts": ["40 76", *XYZ, *abc(1)],
    "plain rows behind two counts, from 0": ["  40   76", *XYZ, *abc(0)],
    "plain rows, one count before each part": ["40", *XYZ, "76", *abc(1)],
    "plain rows behind one count": ["40", *XYZ, *abc(1)],
    "numbered rows": [*numbered(XYZ, 1), *numbered(abc(1), 1)],
    "numbered rows with counts": ["40", *numbered(XYZ, 1), "76", *numbered(abc(1), 1)],
    "numbered rows from 0": ["40 76", *numbered(XYZ, 0), *numbered(abc(0), 0)],
    "comments and blank lines": ["# a comment", "", *XYZ, "   ", "#", *abc(1), ""],
}


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_dialect_of_the_tables_gives_the_same_body(tmp_path, dialect, end):
    found = read_shape(put(tmp_path, end.join(DIALECTS[dialect])), "km")
    same_body(found.mesh)
    assert found.index_base == (0 if "from 0" in dialect else 1)


def test_obj_trimmings_are_skipped_and_other_files_never_opened(tmp_path):
    os.mkfifo(tmp_path / "trap.mtl")  # opening it would hang
    lines = [
        "# comment",
        f"mtllib {tmp_path / 'trap.mtl'}",
        "o body",
        *[f"v {row} 0.5 0.5 0.5" for row in XYZ],
        "vn 0 0 1",
        "vt 0.5 0.5",
        "usemtl rock",
        "s off",
        *[f"f {a}/1/1 {b}//1 {c}/1" for a, b, c in (F + 1).tolist()],
    ]
    same_body(read_mesh(put(tmp_path, "\n".join(lines), "a.obj"), "km"))


def test_units_bom_and_missing_last_line_end(tmp_path):
    text = b"\xef\xbb\xbf" + "\n".join(records()).encode()
    same_body(read_mesh(put(tmp_path, text, "a.obj"), "km"))
    metres = obj_text(BODY, [], "m").encode()
    same_body(read_mesh(put(tmp_path, metres, "b.OBJ"), "m"))


def test_writing_and_reading_gives_the_body_back_and_the_hash_of_the_bytes(tmp_path):
    for unit in ("km", "m"):
        path = tmp_path / f"{unit}.obj"
        write_obj(path, BODY, ["made by a test", "two\nlines"], unit)
        found = read_shape(path, unit)
        same_body(found.mesh)
        assert found.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
        assert path.read_text().startswith("# made by a test\n# two\n# lines\nv ")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["km.obj", "m.obj"]
    assert "-0.000000" not in obj_text(Mesh(V * -0.0, F), [], "km")


def test_a_failed_write_leaves_the_old_file_and_no_rubbish(tmp_path, monkeypatch):
    path = tmp_path / "a.obj"
    path.write_text("old")
    monkeypatch.setattr(os, "fsync", lambda _: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(OutputRefused, match=r"a\.obj: cannot be written: No space left"):
        write_obj(path, BODY, [], "km")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_writing_into_a_missing_folder_is_refused(tmp_path):
    with pytest.raises(OutputRefused, match="No such file"):
        write_obj(tmp_path / "no" / "a.obj", BODY, [], "km")


@pytest.mark.parametrize("kind", ["pipe", "folder"])
def test_only_regular_files_are_replaced(tmp_path, kind):
    path = tmp_path / kind
    os.mkfifo(path) if kind == "pipe" else path.mkdir()
    with pytest.raises(OutputRefused, match="not a regular file"):
        write_obj(path, BODY, [], "km")
    assert list(tmp_path.iterdir()) == [path]


def changed(lines: list[str], at: int, line: str) -> list[str]:
    return [*lines[:at], line, *lines[at + 1 :]]


REFUSED_OBJ = {
    "nan": (changed(records(), 3, "v 0.1 nan 0.2"), r"line 4: 'nan' is not a finite decimal number"),
    "infinity": (changed(records(), 3, "v 0.1 inf 0.2"), r"line 4: 'inf' is not"),
    "overflow": (changed(records(), 3, "v 0.1 1e999 0.2"), r"line 4: a number overflows"),
    "underscore": (changed(records(), 3, "v 0.1 1_0 0.2"), r"line 4: '1_0' is not"),
    "hexadecimal": (changed(records(), 3, "v 0.1 0x1 0.2"), r"'0x1' is not"),
    "words": (changed(records(), 3, "v a b c"), r"line 4: 'a' is not"),
    "half a number": (changed(records(), 3, "v 0.1 1e 0.2"), r"line 4: '1e' is not"),
    "two coordinates": (changed(records(), 3, "v 0.1 0.2"), r"line 4: a vertex of 2 numbers"),
    "index 0": (records(0), r"line \d+: vertex index 0: OBJ counts from 1; .*--index-base 0"),
    "negative index": (
        changed(records(), 40, "f -1 -2 -3"),
        r"line 41: '-1' is not a vertex index \(absolute",
    ),
    "fraction": (changed(records(), 40, "f 1.5 2 3"), r"line 41: '1.5' is not a vertex index"),
    "giant index": (changed(records(), 40, "f 1 2 99999999999999999999"), r"is not a vertex index"),
    "out of range": (
        changed(records(), 40, "f 1 2 41"),
        r"facet 0 \(line 41\): 0-based corners \[0, 1, 40\]",
    ),
    "quadrilateral": (changed(records(), 40, "f 1 2 3 4"), r"line 41: is a quadrilateral; only triangles"),
    "pentagon": (changed(records(), 40, "f 1 2 3 4 5"), r"line 41: is a facet of 5 corners; only triangles"),
    "cut line": ([*records(), "f 1 2"], r"line 117: a facet of 2 corners; is the file cut short"),
    "odd slashes": (changed(records(), 40, "f 1/2/3/4 2 3"), r"'1/2/3/4' is not a vertex index"),
    "unknown record": (["curv 0 1", *records()], r"line 1: 'curv' begins no record"),
    "binary": (["solid\x00\x01\x02"], r"line 1: .* begins no record of an OBJ"),
    "zip": (["PK\x03\x04"], r"'PK\\x03\\x04' begins no record|'PK\x03\x04' begins no record"),
    "empty": ([], "0 vertices and 0 facets"),
    "vertices alone": (records()[:40], "40 vertices and 0 facets"),
    "a facet missing": (records()[:-1], "the surface is open here"),
    "long line": (["# " + "x" * 5000], "line 1: is longer than 4096 bytes"),
}


@pytest.mark.parametrize("case", REFUSED_OBJ)
def test_an_obj_file_is_refused_by_name(tmp_path, case):
    lines, words = REFUSED_OBJ[case]
    with pytest.raises(InputRefused, match=words) as caught:
        read_mesh(put(tmp_path, "\n".join(lines), "a.obj"), "km")
    assert "a.obj" in str(caught.value)


REFUSED_TABLE = {
    "empty": ([], "holds no data"),
    "comments alone": (["# nothing"], "holds no data"),
    "too few vertices": (["41 76", *records()], "declares 41 vertices and holds 40; is the file complete"),
    "too few plates": (["40 76", *XYZ, *abc(1)[:-1]], "declares 76 facets and holds 75"),
    "plates than declared": (["40", *XYZ, "75", *abc(1)], "declares 75 facets and holds 76"),
    "giant counts": (["4000000000 8000000000", *records()], r"line 1: declares \[4000000000, 8000000000\]"),
    "absurd counts": (["9" * 40, *records()], "is not a vertex index"),
    "negative counts": (["-5 7", *records()], "'-5' is not"),
    "count zero": (["0 0"], r"declares \[0, 0\]"),
    "vertices cut": (["40 76", *XYZ[:20]], "declares 40 vertices and holds 20"),
    "count one short": (["39 76", *XYZ, *abc(1)], r"line 41: .* is not a vertex index"),
    "rows of two": (["40 76", *(row.rsplit(" ", 1)[0] for row in XYZ)], "line 2: a row of 2 numbers where 3"),
    "rows of five": ([row + " 1 1" for row in XYZ], "line 1: a row of 5 numbers where 3"),
    "width changes": ([*XYZ[:5], XYZ[5] + " 1.0"], "line 6: a row of 4 numbers where 3 are expected"),
    "quadrilaterals": ([*XYZ, *(f"{row} 7" for row in abc(1))], "not the running number of the row"),
    "a quadrilateral": ([*XYZ, *abc(1)[:3], "1 2 3 4"], "line 44: a row of 4 numbers where 3"),
    "numbers that jump": ([*numbered(XYZ[:9], 1), *numbered(XYZ[9:], 11)], "line 10: .*running number"),
    "nan": ([*XYZ[:5], "0.1 nan 0.3", *XYZ[6:], *abc(1)], "line 6: 'nan' is not a finite"),
    "vertices again": ([*XYZ, *abc(1), XYZ[0]], "is not a vertex index"),
    "neither base": ([*XYZ, *changed(abc(1), 0, "0 1 2")], r"\(line 41\)|0-based corners"),
    "unused first vertex": (["0.0 0.0 0.001", *XYZ, *abc(2)], "vertex 0 .*belongs to no facet"),
}


@pytest.mark.parametrize("case", REFUSED_TABLE)
def test_a_table_is_refused_by_name(tmp_path, case):
    lines, words = REFUSED_TABLE[case]
    with pytest.raises(InputRefused, match=words):
        read_mesh(put(tmp_path, "\r\n".join(lines)), "km")


def test_an_obj_that_counts_from_0_is_read_when_that_is_stated(tmp_path):
    same_body(read_shape(put(tmp_path, "\n".join(records(0)), "a.obj"), "km", index_base=0).mesh)


def test_a_wrongly_stated_base_is_refused(tmp_path):
    with pytest.raises(InputRefused, match=r"\[.*\] do not all lie in 0\.\.39"):
        read_shape(put(tmp_path, "\n".join(records(0))), "km", index_base=1)


def test_the_wrong_unit_is_refused_with_the_right_one(tmp_path):
    path = put(tmp_path, "\n".join(records()))
    with pytest.raises(InputRefused, match=r"0\.5763 m across.*are the coordinates in km"):
        read_mesh(path, "m")


def test_only_regular_files_are_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe.obj")
    with socket.socket(socket.AF_UNIX) as unix:
        unix.bind(str(tmp_path / "socket.obj"))
        for name, words in {
            "pipe.obj": "is a pipe",
            "socket.obj": "cannot be read",
            ".": "is a directory",
            "/dev/zero": "is a device",
            "missing.obj": "cannot be read: No such file",
            "a\0b": "cannot be read",
        }.items():
            began = time.process_time()
            with pytest.raises(InputRefused, match=words):
                read_raw(f"{tmp_path}/{name}" if not name.startswith("/") else name)
            assert time.process_time() - began < 0.5


def test_an_oversized_file_is_refused_before_a_byte_is_read(tmp_path):
    path = tmp_path / "huge.obj"
    with path.open("wb") as stream:
        stream.truncate(shape_lines.SIZE_CAP_BYTES + 1)  # sparse
    with pytest.raises(InputRefused, match="has 256 MiB; at most 256 MiB are read"):
        read_raw(path)


def test_a_sparse_file_of_zeros_is_refused_at_its_first_block(tmp_path):
    path = tmp_path / "zeros.obj"
    with path.open("wb") as stream:
        stream.truncate(200 * 2**20)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputRefused, match="longer than 4096 bytes"):
        read_raw(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 50_000  # kB


def test_lines_are_right_where_a_file_is_read_in_many_blocks(tmp_path, monkeypatch):
    monkeypatch.setattr(shape_lines, "_BLOCK_BYTES", 100)
    monkeypatch.setattr(shape_lines, "_BATCH_ROWS", 7)
    same_body(read_mesh(put(tmp_path, "\r\n".join(["# head", *DIALECTS["numbered rows with counts"]])), "km"))
    lines, _ = REFUSED_OBJ["out of range"]
    with pytest.raises(InputRefused, match=r"facet 0 \(line 41\)"):
        read_mesh(put(tmp_path, "\n".join(lines), "a.obj"), "km")


def test_forty_thousand_facets_are_read_in_a_fraction_of_a_second(tmp_path):
    path = tmp_path / "big.obj"
    write_obj(path, fibonacci_ellipsoid((300.0, 200.0, 150.0), 20_002), [], "km")
    began = time.process_time()
    assert len(read_raw(path).faces) == 40_000
    assert time.process_time() - began < 1.5  # 0.14 s measured


GOOD_OBJ = "\n".join(records()).encode()
GOOD_TABLE = "\n".join(DIALECTS["numbered rows with counts"]).encode()


def read_or_refuse(path: Path) -> None:
    try:
        mesh = read_mesh(path, "km")
    except InputRefused as refusal:
        assert str(refusal)
        return
    assert np.isfinite(mesh.vertices).all()
    assert mesh.faces.min() >= 0
    assert mesh.faces.max() < len(mesh.vertices)


FUZZ = settings(
    max_examples=120,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    database=None,
)


@FUZZ
@given(st.binary(max_size=300), st.sampled_from([".obj", ".tab"]))
@example(b"3", ".tab")
@example(b"v", ".obj")
@example(b"f / // ///", ".obj")
@example(b"40\n\n\n", ".tab")
@example(b"4 4\n1 2 3 4\n", ".tab")
def test_any_bytes_are_read_or_refused(tmp_path, data, suffix):
    read_or_refuse(put(tmp_path, data, f"fuzz{suffix}"))


@FUZZ
@given(
    st.sampled_from([(GOOD_OBJ, ".obj"), (GOOD_TABLE, ".tab")]),
    st.lists(st.tuples(st.integers(0, 4000), st.binary(min_size=0, max_size=4)), min_size=1, max_size=4),
    st.integers(0, 8000),
)
def test_a_damaged_file_is_read_or_refused(tmp_path, good, edits, cut):
    data, suffix = good
    for at, patch in edits:
        data = data[:at] + patch + data[at + len(patch) + (not patch) :]
    read_or_refuse(put(tmp_path, data[: max(cut, 50)], f"fuzz{suffix}"))


@FUZZ
@given(st.text(alphabet="0123456789 .-+eEvf/#\n\r\t", max_size=200), st.sampled_from([".obj", ".tab"]))
def test_any_text_of_the_alphabet_is_read_or_refused(tmp_path, text, suffix):
    read_or_refuse(put(tmp_path, text, f"fuzz{suffix}"))

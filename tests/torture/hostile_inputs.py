"""Scenarios and shapes from strangers, each by name: refused, or accepted where right, at little cost.

``python hostile_inputs.py`` reads each in a process of its own and prints what came of it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from programs import ROOT, Tally, environment

sys.path.insert(0, str(ROOT / "tests"))

from scenario_samples import MINIMAL, OCTAHEDRON

CPU_LIMIT_S, MEMORY_LIMIT_MB = 1.0, 200.0
LEVELS = 100_000
MIB = 1 << 20
Made = bytes | Callable[[Path], None]  # what is in the file, or how to make something that is none


def _with(line: str, other: str) -> bytes:
    assert line in MINIMAL
    return MINIMAL.replace(line, other).encode()


def _sparse(path: Path) -> None:
    path.touch()
    os.truncate(path, 1 << 40)


TOF = "tof_s: [700, 900]"
BOMB = "".join(f"{b}: &{b} [*{a}, *{a}, *{a}, *{a}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True))
# name: what is read, and the words that the refusal must hold; no words: it is accepted
SCENARIOS: dict[str, tuple[Made, tuple[str, ...]]] = {
    "alias bomb": (b"a: &a [x, x, x, x]\n" + BOMB.encode(), (":1:", "a:", "anchors and aliases")),
    "100,000 brackets": (b"a: " + b"[" * LEVELS, (":1:", "nested deeper than 16")),
    "100,000 braces": (b"a: " + b"{b: " * LEVELS, (":1:", "nested deeper than 16")),
    "duplicate key": (_with(TOF, f"{TOF}\n  {TOF}"), (":12:", "reach.tof_s", "given twice")),
    "4:17": (_with(TOF, "tof_s: 4:17"), (":11:", "reach.tof_s", "4:17")),
    "1e3": (_with(TOF, "tof_s: 1e3"), ()),
    "on": (_with(TOF, "tof_s: on"), (":11:", "reach.tof_s", "'on'")),
    "NaN": (_with(TOF, "tof_s: .nan"), (":11:", "reach.tof_s", "not a finite number")),
    "nan as text": (_with(TOF, "tof_s: nan"), (":11:", "reach.tof_s", "'nan'")),
    "infinity": (_with(TOF, "tof_s: .inf"), (":11:", "reach.tof_s", "not a finite number")),
    "overflowing number": (_with(TOF, "tof_s: 1e999"), (":11:", "reach.tof_s", "not a finite number")),
    "huge integer": (_with(TOF, f"tof_s: {'9' * 4000}"), (":11:", "reach.tof_s", "larger than any")),
    "huge number": (_with(TOF, "tof_s: 1e300"), (":11:", "reach.tof_s", "1e+300")),
    "not UTF-8": (_with("name: probe", "name: pröbe").decode().encode("latin-1"), (":1:", "not UTF-8")),
    "UTF-16": (MINIMAL.encode("utf-16"), ("not UTF-8",)),
    "byte-order mark": (b"\xef\xbb\xbf" + MINIMAL.encode(), ()),
    "tab": (_with(f"  {TOF}", f"\t{TOF}"), (":11:", "tab")),
    "CRLF": (MINIMAL.replace("\n", "\r\n").encode(), ()),
    "lone CR": (MINIMAL.replace("\n", "\r").encode(), ()),
    "empty": (b"", ("is empty",)),
    "NUL": (_with("name: probe", "name: pro\0be"), (":1:", "character")),
    "directory": (Path.mkdir, ("is a directory",)),
    "FIFO": (os.mkfifo, ("is a pipe",)),
    "/dev/zero": (lambda path: path.symlink_to("/dev/zero"), ("is a device",)),
    "/dev/full": (lambda path: path.symlink_to("/dev/full"), ("is a device",)),
    "endless link": (lambda path: path.symlink_to(path), ("scenario.yaml",)),
    "1 MiB and a byte": (b"#" * (MIB + 1), ("1 MiB",)),
    "1 TiB, sparse": (_sparse, ("at most 1 MiB",)),
    "1 MiB of brackets": (b"[" * MIB, ("nested deeper",)),
    "1 MiB of dashes": (b"- " * (MIB // 2), ("nested deeper",)),
    "1 MiB of questions": (b"? " * (MIB // 2), (":1:", "a key must be a plain word")),
    "1 MiB of values": (b"- 1\n" * (MIB // 4), ("more than 20000 values",)),
    "1 MiB of comments": (b"# x\n" * (MIB // 4), ("is empty",)),
    "1 MiB of keys": (b"a: " * (MIB // 3), ("scenario.yaml:1",)),
    "object tag": (b"a: !!python/object/apply:os.system [ls]\n", (":1:", "a:", "tag")),
    "second document": (MINIMAL.encode() + b"---\na: 1\n", (":13:", "second document")),
    "shape by URL": (_with("octahedron.obj", "http://127.0.0.1:9/x.obj"), ("body.shape",)),
    "shape that is a FIFO": (_with("octahedron.obj", "trap.mtl"), ("body.shape", "is a pipe")),
}


def _rows(*changes: tuple[str, str], more: str = "") -> bytes:
    text = OCTAHEDRON
    for line, other in changes:
        assert line in text
        text = text.replace(line, other)
    return (text + more).encode()


VERTICES = [line.split()[1:] for line in OCTAHEDRON.splitlines() if line[0] == "v"]
FACETS = [line.split()[1:] for line in OCTAHEDRON.splitlines() if line[0] == "f"]


def _obj(vertices: list[list[str]], facets: list[list[str]]) -> bytes:
    lines = [f"v {' '.join(v)}" for v in vertices] + [f"f {' '.join(f)}" for f in facets]
    return "\n".join([*lines, ""]).encode()


MOVED = [[str(float(x) + 2000), y, z] for x, y, z in VERTICES]
TWO = _obj(VERTICES + MOVED, FACETS + [[str(int(i) + 6) for i in f] for f in FACETS])
SHAPES: dict[str, tuple[str, Made, tuple[str, ...]]] = {
    "sound": (".obj", _rows(), ()),
    "mtllib to a FIFO": (".obj", _rows(more="mtllib trap.mtl\nusemtl x\n"), ()),
    "mtllib to the network": (".obj", _rows(more="mtllib http://127.0.0.1:9/x.mtl\n"), ()),
    "NaN": (".obj", _rows(("v 0 250 0", "v 0 nan 0")), ("line 3", "'nan' is not a finite")),
    "infinity": (".obj", _rows(("v 0 250 0", "v 0 1e999 0")), ("line 3", "overflows")),
    "index 0": (".obj", _rows(("f 1 3 5", "f 0 3 5")), ("line 7", "vertex index 0")),
    "index out of range": (".obj", _rows(("f 1 3 5", "f 1 3 7")), ("line 7", "0..5")),
    "negative index": (".obj", _rows(("f 1 3 5", "f -1 3 5")), ("line 7", "'-1' is not a vertex index")),
    "quads": (".obj", _rows(("f 1 3 5", "f 1 3 5 2")), ("line 7", "quadrilateral")),
    "truncated in a line": (".obj", _rows()[:-4], ("line 14", "cut short")),
    "truncated between lines": (".obj", _rows()[:-8], ("open",)),
    "empty": (".obj", b"", ("0 vertices and 0 facets",)),
    "flat": (".obj", _obj([[x, y, "0"] for x, y, _ in VERTICES], FACETS), ("flat",)),
    "inverted": (".obj", _obj(VERTICES, [[a, c, b] for a, b, c in FACETS]), ("inwards",)),
    "two bodies": (".obj", TWO, ("facet 8", "2 separate surfaces")),
    "non-manifold": (".obj", _rows(more="v 0 0 500\nf 1 3 7\n"), ("edge",)),
    "giant counts": (".tab", b"4000000000 8000000000\n" + _rows(), ("line 1", "4000000000")),
    "absurd counts": (".tab", b"9" * 4000 + b"\n", ("line 1",)),
    "a thousand in each cell": (".tab", b"1 " * 2000 + b"\n", ("line 1",)),
    "line of 1 MiB": (".obj", b"v " * (MIB // 2), ("line 1", "longer than 4096 bytes")),
    "zip": (".obj", b"PK\x03\x04" + bytes(100), ("line 1", "begins no record")),
    "gzip": (".tab", b"\x1f\x8b\x08\x00" + bytes(100), ("line 1",)),
    "1 TiB, sparse": (".obj", _sparse, ("at most 256 MiB",)),
    "directory": (".obj", Path.mkdir, ("is a directory",)),
    "FIFO": (".obj", os.mkfifo, ("is a pipe",)),
    "/dev/zero": (".obj", lambda path: path.symlink_to("/dev/zero"), ("is a device",)),
    "other format": (".stl", b"solid x\nfacet normal 0 0 1\n", ("line 1",)),
}


def hostile_inputs() -> list[Tally]:
    """Read all of them, in a process of its own that is small to begin with."""
    command = [sys.executable, __file__]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment())
    tallies = {name: Tally(f"hostile {name}") for name in ("scenarios", "shapes")}
    if done.returncode:
        tallies["scenarios"].record("the reader", [f"ended with {done.returncode}: {done.stderr[-300:]}"])
    for line in done.stdout.splitlines():
        name, case, complaints = json.loads(line)
        tallies[name].record(case, complaints)
    return list(tallies.values())


def _read(path: Path, kind: str) -> None:
    if kind == "scenarios":
        from landing_cli.scenario.build import build
        from landing_cli.scenario.load import load

        build(load(str(path)))
    else:
        from landing_cli.sources.shape_files import read_shape

        read_shape(path, "m")


def _complaints(path: Path, kind: str, words: tuple[str, ...]) -> list[str]:
    """Read one file in a child, and hold it to its words, 1 s of CPU and 200 MB."""
    from landing_cli.errors import InputRefused

    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        try:
            _read(path, kind)
            told = ""
        except InputRefused as error:
            told = str(error)
        except BaseException as error:
            told = f"{type(error).__name__}: {error}"
        os.write(writing, told.encode()[:4000])
        os._exit(0)
    os.close(writing)
    told = os.read(reading, 4000).decode(errors="replace")
    os.close(reading)
    _, status, used = os.wait4(child, 0)
    cpu_s, peak_mb = used.ru_utime + used.ru_stime, used.ru_maxrss / 1024
    missing = [word for word in (*words, *([path.name] if words else [])) if word not in told]
    wrong = [f"ended with {os.waitstatus_to_exitcode(status)}"] if status else []
    wrong += [f"does not say {missing}: {told!r}"] if missing else []
    wrong += [f"refused: {told!r}"] if told and not words else []
    wrong += [f"took {cpu_s:.2f} s of CPU"] if cpu_s > CPU_LIMIT_S else []
    wrong += [f"took {peak_mb:.0f} MB"] if peak_mb > MEMORY_LIMIT_MB else []
    return wrong


def main(folder: Path) -> None:
    (folder / "octahedron.obj").write_text(OCTAHEDRON)
    os.mkfifo(folder / "trap.mtl")
    sound = folder / "sound.yaml"
    sound.write_text(MINIMAL)
    _read(sound, "scenarios")  # what is imported and compiled is nobody's fault
    named = [("scenarios", case, ".yaml", made, words) for case, (made, words) in SCENARIOS.items()]
    named += [("shapes", case, *rest) for case, rest in SHAPES.items()]
    for kind, case, suffix, made, words in named:
        path = folder / f"{kind[:-1]}{suffix}"
        if callable(made):
            made(path)
        else:
            path.write_bytes(made)
        print(json.dumps([kind, case, _complaints(path, kind, words)]), flush=True)
        path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(prefix="hostile-") as place:
        main(Path(place))

"""Results forged with a valid seal, each with one impossible value: refused, or read without harm.

``python forge_results.py GOOD.h5 EVERY SHARE/SHARES`` forges every EVERY-th possibility that falls to this
share and prints what went wrong.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from programs import ROOT, Tally, environment, finish, reach_run

sys.path.insert(0, str(ROOT / "tests"))

from scenario_samples import MINIMAL, OCTAHEDRON

from landing_cli.results.store import read, write
from landing_cli.results.tree import Dataset, Group

COMMANDS = (
    ("show", "--json"),
    ("show", "--facet", "0"),
    ("export", "--table", "summary"),
    ("export",),
    ("export", "--table", "boundary"),
    ("export", "--table", "trajectory", "--facet", "0", "--case", "{case}"),
    ("export", "--format", "vtp", "--case", "{case}"),
    ("verify", "--jobs", "1"),
    ("diff", "{good}"),
)
REFUSED = 3
ALLOWED = (0, REFUSED, 5)  # 5: does not verify
CPU_LIMIT_S = 20
ABSENT = object()


def forge_results(folder: Path, every: int = 1) -> Tally:
    """Solve a body of eight facets, forge its result and read that, in a process of its own."""
    tally = Tally("results forged with a valid seal")
    (folder / "octahedron.obj").write_text(OCTAHEDRON)
    scenario, good = folder / "octahedron.yaml", folder / "octahedron.h5"
    scenario.write_text(MINIMAL.replace("model: point_mass", "model: polyhedron"))
    ended = finish(reach_run(str(scenario)).command(good, "threads", 1, "--compare"))
    if ended.code:
        tally.record("the good file", [f"exit code {ended.code}: {ended.stderr[-300:]}"])
        return tally
    shares = os.cpu_count() or 1
    commands = [[sys.executable, __file__, str(good), str(every), f"{n}/{shares}"] for n in range(shares)]
    with ThreadPoolExecutor(shares) as pool:
        for done in pool.map(_forger, commands):
            if done.returncode:
                tally.record("the forger", [f"ended with {done.returncode}: {done.stderr[-300:]}"])
            for line in done.stdout.splitlines():
                tally.record(*json.loads(line))
    return tally


def _forger(command: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment())


def forgeries(group: Group, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Group]]:
    """Yield every forged tree with the name of what was forged."""
    for name, value in group.attributes.items():
        for told, other in _values(value):
            attributes = {k: v for k, v in {**group.attributes, name: other}.items() if v is not ABSENT}
            yield f"{'/'.join((*path, name))} {told}", replace(group, attributes=attributes)
    for name, member in group.members.items():
        here = (*path, name)
        inner = forgeries(member, here) if isinstance(member, Group) else _datasets(member, "/".join(here))
        for told, other in inner:
            yield told, replace(group, members={**group.members, name: other})
        rest = {k: v for k, v in group.members.items() if k != name}
        yield f"{'/'.join((*path, name))} absent", replace(group, members=rest)


def _values(value: Any) -> Iterator[tuple[str, Any]]:
    yield "absent", ABSENT
    others = [float("nan"), float("inf"), -1, 0, 1e300, 2**62, "text", np.array([1.0, 2.0]), np.zeros(3)]
    yield from ((f"= {other!r}", other) for other in others)


def _datasets(dataset: Dataset, where: str) -> Iterator[tuple[str, Dataset]]:
    data = dataset.data
    if data.dtype.kind in "iuf" and data.size:
        extremes = [np.nan, np.inf, -1.0, 1e300] if data.dtype.kind == "f" else _extremes(data.dtype)
        for extreme in extremes:
            changed = data.copy()
            changed.reshape(-1)[-1] = extreme
            yield f"{where} last = {extreme}", replace(dataset, data=changed)
            yield f"{where} all = {extreme}", replace(dataset, data=np.full_like(data, extreme))
        yield f"{where} as text", replace(dataset, data=data.astype("U"))
        yield (
            f"{where} as numbers of another kind",
            replace(dataset, data=np.nan_to_num(data).astype("f4" if data.dtype.kind != "f" else "i4")),
        )
    yield f"{where} shorter", replace(dataset, data=data[:-1])
    yield f"{where} empty", replace(dataset, data=data[:0])
    if data.ndim > 1:
        yield f"{where} narrower", replace(dataset, data=np.ascontiguousarray(data[:, :-1]))


def _extremes(dtype: np.dtype[Any]) -> list[int]:
    info = np.iinfo(dtype)
    return sorted({int(info.min), int(info.max), min(200, int(info.max)), max(-1, int(info.min))})


def _write_forged(path: Path, tree: Group) -> bool:
    """Write what a forger would, past our own writer's checks; False where HDF5 itself cannot hold it."""
    try:
        write(path, tree, {}, {})
    except (ValueError, KeyError, TypeError):  # dimensions that clash
        return False
    return True


def _complaints(path: Path, good: Path) -> list[str]:
    """Run every command on one forged file, each in a child that may crash."""
    from landing_cli.cli.app import main

    complaints = []
    for command in COMMANDS:
        told = tempfile.TemporaryFile("w+")  # noqa: SIM115
        child = os.fork()
        if not child:
            resource.setrlimit(resource.RLIMIT_CPU, (CPU_LIMIT_S, CPU_LIMIT_S))
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            os.dup2(told.fileno(), 2)
            os._exit(main("landing", _arguments(command, path, good)))
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        told.seek(0)
        text = told.read()
        told.close()
        if command is COMMANDS[0] and status == REFUSED and "Traceback" not in text:
            return []  # by the reader, which every command asks first
        if status not in ALLOWED or "Traceback" in text or "RuntimeWarning" in text:
            complaints.append(f"{' '.join(command)}: exit code {status}: {text.strip()[-300:]}")
    return complaints


def _arguments(command: tuple[str, ...], path: Path, good: Path) -> list[str]:
    case = sorted(read(good).tree.group("cases").members)[0]
    return ["results", command[0], str(path), *(w.format(case=case, good=good) for w in command[1:])]


def main(good: Path, every: int, share: int = 0, shares: int = 1) -> None:
    tree = read(good).tree
    _warm(good)
    if wrong := _complaints(good, good):
        sys.exit(f"the good file itself: {wrong}")
    with tempfile.TemporaryDirectory(prefix="forged-") as folder:
        path = Path(folder) / "forged.h5"
        for number, (told, forged) in enumerate(forgeries(tree)):
            if number % (every * shares) == every * share and _write_forged(path, forged):
                print(json.dumps([told, _complaints(path, good)]), flush=True)


def _warm(good: Path) -> None:
    """Import and load in the parent what every child would."""
    from landing_cli.cli.app import main as run

    out = os.dup(1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    for command in COMMANDS:
        run("landing", _arguments(command, good, good))
    sys.stdout.flush()
    os.dup2(out, 1)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), *map(int, sys.argv[3].split("/")))

"""Torture runs and files, and print a table of what was tried and passed.

``python tests/torture --kills 200`` tortures ``reach run``; ``--program toy`` a stand-in with the same
dispatch, journal, store, signals and exit codes, whose runs take a second;
``--parts kills disks`` does some parts only.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from choices import choices
from damage_scenarios import SHIPPED, damage_scenario
from flip_bits import flip_bits
from forge_results import forge_results
from hostile_disks import hostile_disks
from hostile_inputs import hostile_inputs
from kill_runs import kill_runs
from kill_workers import deadly_facet, finish_deadly, kill_dask_workers, kill_workers
from overhead import overhead
from programs import TOY, Reference, Tally, reach_isochrone, reach_run
from same_numbers import same_numbers

# a small case of the real command: one start, two times of flight, some 5000 facets
SMALL = ("reach.initial_states=[{name: north_pole, position_km: [0, 0, 0.8]}]", "reach.tof_s=[600, 700]")


def _kills(reference: Reference, folder: Path, arguments: argparse.Namespace) -> list[Tally]:
    return kill_runs(reference, arguments.kills, folder, arguments.seed)


def _workers(reference: Reference, folder: Path, arguments: argparse.Namespace) -> list[Tally]:
    return [
        kill_workers(reference, arguments.workers, folder, arguments.seed),
        kill_dask_workers(reference, arguments.workers, folder, arguments.seed),
        deadly_facet(reference, folder),
    ]


def _disks(reference: Reference, folder: Path, arguments: argparse.Namespace) -> list[Tally]:
    return [choices(reference, folder), *hostile_disks(reference, folder)]


def _numbers(reference: Reference, folder: Path, arguments: argparse.Namespace) -> list[Tally]:
    return [same_numbers(reference, folder), overhead(reference)]


def _flips(reference: Reference, folder: Path, arguments: argparse.Namespace) -> list[Tally]:
    copy = folder / "flipped.h5"
    shutil.copy(reference.result, copy)
    output = folder / "partial" / "run.h5"
    finish_deadly(reference, output)
    journal = output.with_name("run.h5.journal")
    with ThreadPoolExecutor() as pool:  # each in a process of its own
        result_flips = pool.submit(flip_bits, "result", copy, arguments.flips)
        journal_flips = pool.submit(flip_bits, "journal", journal, arguments.flips // 4)
        return [result_flips.result(), journal_flips.result()]


def _inputs(reference: Reference, folder: Path, arguments: argparse.Namespace) -> list[Tally]:
    return [*hostile_inputs(), *map(damage_scenario, SHIPPED), forge_results(folder, arguments.forge_every)]


PARTS: dict[str, Callable[[Reference, Path, argparse.Namespace], list[Tally]]] = {
    "inputs": _inputs,
    "flips": _flips,
    "numbers": _numbers,
    "disks": _disks,
    "workers": _workers,
    "kills": _kills,
}


def torture(arguments: argparse.Namespace, folder: Path) -> list[Tally]:
    sets = arguments.set or SMALL
    real = reach_isochrone if arguments.program == "isochrone" else reach_run
    program = TOY if arguments.program == "toy" else real(arguments.scenario, *sets)
    reference = Reference.make(program, folder)
    tallies = []
    for part in arguments.parts:
        tallies += PARTS[part](reference, folder, arguments)
        print(f"{part}: done", file=sys.stderr, flush=True)
    return tallies


def table(tallies: list[Tally]) -> str:
    width = max(len(t.name) for t in tallies)
    lines = [f"{'what':<{width}}  tried  passed"]
    for tally in tallies:
        lines.append(f"{tally.name:<{width}}  {tally.tried:5d}  {tally.passed:6d}")
        if tally.notes:
            lines.append("    " + ", ".join(f"{note} {n}" for note, n in sorted(tally.notes.items())))
        lines += [f"    {failure}" for failure in tally.failures[:5]]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--program", choices=["toy", "reach", "isochrone"], default="reach")
    parser.add_argument("--parts", nargs="+", choices=list(PARTS), default=list(PARTS))
    parser.add_argument("--scenario", default="bennu.yaml", help="for --program reach")
    parser.add_argument(
        "--set", action="append", default=[], help="for --program reach: KEY=VALUE; a small case unless given"
    )
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--workers", type=int, default=2, help="runs whose workers are killed")
    parser.add_argument("--flips", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--forge-every", type=int, default=1, help="forge every N-th value of a result")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="torture-", ignore_cleanup_errors=True) as folder:
        tallies = torture(arguments, Path(folder))
    print(table(tallies))
    return int(any(t.failures for t in tallies))


if __name__ == "__main__":
    sys.exit(main())

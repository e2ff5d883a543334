"""Torture runs and files, and print a table of what was tried and passed.

``python tests/torture --kills 200``; ``--program reach`` tortures ``reach run``, else a toy with the same
dispatch, journal, store, signals and exit codes.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

from flip_bits import flip_bits
from hostile_disks import hostile_disks
from kill_runs import kill_runs
from kill_workers import deadly_facet, finish_deadly, kill_workers
from programs import TOY, Reference, Tally, reach_run
from same_numbers import same_numbers


def torture(arguments: argparse.Namespace, folder: Path) -> list[Tally]:
    program = TOY if arguments.program == "toy" else reach_run(arguments.scenario, *arguments.set)
    reference = Reference.make(program, folder)
    tallies = kill_runs(reference, arguments.kills, folder, arguments.seed)
    tallies.append(kill_workers(reference, arguments.workers, folder, arguments.seed))
    tallies.append(deadly_facet(reference, folder))
    tallies += hostile_disks(reference, folder)
    tallies.append(same_numbers(reference, folder, dask=not arguments.no_dask))
    copy = folder / "flipped.h5"
    shutil.copy(reference.result, copy)
    tallies.append(flip_bits("result", copy, arguments.flips))
    output = folder / "partial" / "run.h5"
    finish_deadly(reference, output)
    tallies.append(flip_bits("journal", output.with_name("run.h5.journal"), arguments.flips // 4))
    return tallies


def table(tallies: list[Tally]) -> str:
    width = max(len(t.name) for t in tallies)
    lines = [f"{'what':<{width}}  tried  passed"]
    for tally in tallies:
        lines.append(f"{tally.name:<{width}}  {tally.tried:5d}  {tally.passed:6d}")
        if tally.stages:
            lines.append("    " + ", ".join(f"{stage} {n}" for stage, n in sorted(tally.stages.items())))
        lines += [f"    {failure}" for failure in tally.failures[:5]]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--program", choices=["toy", "reach"], default="toy")
    parser.add_argument("--scenario", default="bennu.yaml", help="for --program reach")
    parser.add_argument("--set", action="append", default=[], help="for --program reach: KEY=VALUE")
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--workers", type=int, default=2, help="runs whose workers are killed")
    parser.add_argument("--flips", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--no-dask", action="store_true")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="torture-") as folder:
        tallies = torture(arguments, Path(folder))
    print(table(tallies))
    return int(any(t.failures for t in tallies))


if __name__ == "__main__":
    sys.exit(main())

"""Where the CPU of one command goes: ``reach run bennu.yaml`` from start to table, caches warm.

``python -m bench end-to-end`` runs the command in a process of its own with a stopwatch of CPU time around
every step, and prints the breakdown; what is not solving should be under a third. Beside it, the CPU time of
``reach --help``.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

STEPS = {
    "start": "Python, command line",
    "imports": "imports of the solver",
    "scenario": "scenario read and checked",
    "body": "shape read and checked, gravity",
    "prepare": "surface index, gravity bounds",
    "kernels": "kernels from the cache",
    "solve": "facets solved",
    "journal": "journal",
    "summary": "summaries",
    "write": "result file",
    "print": "table printed",
    "rest": "everything else",
}


class Stopwatch:
    """CPU time by step; a step inside another counts for itself alone."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = {}
        self._inner = [0.0]

    def around(self, step: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Make a function whose CPU time counts for a step."""

        def timed(*args: Any, **options: Any) -> Any:
            begun = time.process_time()
            self._inner.append(0.0)
            try:
                return function(*args, **options)
            finally:
                took = time.process_time() - begun
                self.spent[step] = self.spent.get(step, 0.0) + took - self._inner.pop()
                self._inner[-1] += took

        return timed


def child(arguments: list[str]) -> None:
    """Run the command under the stopwatch; the breakdown goes to stderr as JSON, last."""
    from landing_cli.cli.app import main as run_program

    watch = Stopwatch()
    watch.spent["start"] = time.process_time()
    watch.around("imports", _import_solver)()
    import landing_cli.cli.reach as command
    import landing_cli.reach.pipeline as pipeline
    import landing_cli.scenario.load as load

    def prepare(cases: Any) -> Any:
        made = watch.around("prepare", pipeline_prepare)(cases)
        few = made, len(made[0].shared.centroids_m), pipeline.np.arange(8)
        watch.around("kernels", solve_items)(*few)
        return made

    pipeline_prepare, solve_items = pipeline._prepare, pipeline.solve_items
    pipeline._prepare = prepare
    pipeline.solve_items = watch.around("solve", solve_items)
    pipeline.build = watch.around("body", pipeline.build)
    pipeline.summarise = watch.around("summary", pipeline.summarise)
    pipeline.run_to_tree = watch.around("write", pipeline.run_to_tree)
    pipeline.finish_output = watch.around("write", pipeline.finish_output)
    pipeline.Journal.append = watch.around("journal", pipeline.Journal.append)
    load.load = watch.around("scenario", load.load)
    command.print_run = watch.around("print", command.print_run)
    code = run_program("reach", ["run", *arguments])
    total = time.process_time()
    watch.spent["rest"] = total - sum(watch.spent.values())
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"steps": watch.spent, "total": total, "peak_mb": peak_mb}), file=sys.stderr)
    sys.exit(code)


def _import_solver() -> None:
    import landing_cli.reach.pipeline  # noqa: F401


def cpu_of_help() -> float:
    """CPU time of ``reach --help``, s: the least of three."""
    call = [sys.executable, "-c", "from landing_cli.cli.app import main; main('reach', ['--help'])"]
    times = []
    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(call, capture_output=True, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(times)


def breakdown(scenario: str, overrides: list[str]) -> dict[str, Any]:
    """CPU time by step of one run of the command, the second: the first fills the caches."""
    with tempfile.TemporaryDirectory() as folder:
        # Python's own bytecode is kept wherever the package is used, but not in every workshop
        kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        environment = {**kept, "PYTHONPYCACHEPREFIX": str(Path(folder) / "bytecode")}
        sets = [word for override in overrides for word in ("--set", override)]
        for name in ("first.h5", "run.h5"):
            call = ["--child", scenario, "-o", str(Path(folder) / name), "-j", "1", "-q", *sets]
            run = [sys.executable, "-m", "bench.end_to_end_bench", *call]
            told = subprocess.run(run, capture_output=True, check=True, text=True, env=environment).stderr
    found: dict[str, Any] = json.loads(told.splitlines()[-1])
    return found


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(prog="python -m bench end-to-end", description=__doc__.splitlines()[0])
    parser.add_argument("--scenario", default="bennu.yaml")
    parser.add_argument("--set", action="append", default=[], dest="overrides", help="override a key")
    options = parser.parse_args()
    found = breakdown(options.scenario, options.overrides)
    total = found["total"]
    print(f"{'step':34s}{'CPU s':>8s}{'share':>9s}")
    for step, told in STEPS.items():
        spent = found["steps"].get(step, 0.0)
        print(f"{told:34s}{spent:8.2f}{spent / total:9.1%}")
    other = total - found["steps"]["solve"]
    print(f"{'all':34s}{total:8.2f}; not solving {other:.2f} s, {other / total:.1%}")
    print(f"peak memory {found['peak_mb']:.0f} MB; `reach --help` takes {cpu_of_help():.2f} s of CPU")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2:])
    else:
        main()

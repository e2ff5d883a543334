"""The programs that are tortured, and what is known of one run of them."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from landing_cli.results.store import read

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PATIENCE_S = 600.0


@dataclass(frozen=True)
class Program:
    """A command that writes a result: the toy of this folder, or the real one."""

    name: str
    words: tuple[str, ...]
    traces: bool = False

    def command(self, output: Path, backend: str = "threads", jobs: int = 2, *more: str) -> list[str]:
        plan = ["--backend", backend, "--jobs", str(jobs)]
        trace = ["--trace", str(trace_of(output))] if self.traces else []
        return [sys.executable, *self.words, "-o", str(output), *plan, *trace, *more]


TOY = Program("toy", (str(HERE / "toy_run.py"),), traces=True)


def reach_run(scenario: str, *sets: str) -> Program:
    """Return ``reach run`` on a scenario, with overrides like ``reach.tof_s=700``."""
    start = "from landing_cli.cli.app import reach; reach()"
    overrides = [word for key in sets for word in ("--set", key)]
    return Program("reach run", ("-c", start, "run", scenario, *overrides))


def trace_of(output: Path) -> Path:
    return output.with_name("trace.txt")


def environment(**more: str) -> dict[str, str]:
    path = os.pathsep.join([str(HERE), str(ROOT), os.environ.get("PYTHONPATH", "")])
    return {**os.environ, "PYTHONPATH": path, **more}


@dataclass
class Ended:
    """How a command ended."""

    code: int
    stdout: str
    stderr: str
    seconds: float


def finish(command: Sequence[str], variables: Mapping[str, str] | None = None, **options: object) -> Ended:
    """Run a command to its end."""
    start = time.monotonic()
    done = subprocess.run(
        command,
        capture_output="stdout" not in options,
        stderr=subprocess.PIPE if "stdout" in options else None,
        text=True,
        check=False,
        timeout=PATIENCE_S,
        env=environment(**(variables or {})),
        **options,  # type: ignore[call-overload]
    )
    return Ended(done.returncode, done.stdout or "", done.stderr or "", time.monotonic() - start)


def digest_of(output: Path) -> str:
    return read(output).digest


@dataclass
class Tally:
    """What was tried under one name, and what failed."""

    name: str
    tried: int = 0
    failures: list[str] = field(default_factory=list)

    def record(self, case: str, complaints: Sequence[str]) -> None:
        self.tried += 1
        if complaints:
            self.failures.append(f"{case}: {'; '.join(complaints)}")

    @property
    def passed(self) -> int:
        return self.tried - len(self.failures)


@dataclass(frozen=True)
class Reference:
    """The undisturbed run that every disturbed one must equal."""

    program: Program
    digest: str
    seconds: Mapping[str, float]

    @classmethod
    def make(cls, program: Program, folder: Path, backends: Sequence[str] = ("threads", "loky")) -> Reference:
        digests, seconds = set(), {}
        for backend in backends:
            output = folder / f"undisturbed-{backend}" / "run.h5"
            ended = finish(program.command(output, backend))
            assert ended.code == 0, ended.stderr
            digests.add(digest_of(output))
            seconds[backend] = ended.seconds
        assert len(digests) == 1, "the backends differ"
        return cls(program, digests.pop(), seconds)

    def resumed(self, output: Path, backend: str = "threads", *more: str) -> list[str]:
        """Resume a run and say what is wrong with the outcome."""
        ended = finish(self.program.command(output, backend, 2, "--resume", *more))
        if ended.code != 0:
            return [f"--resume ended with {ended.code}: {ended.stderr.strip()[-200:]}"]
        complaints = [] if digest_of(output) == self.digest else ["the resumed result differs"]
        left = {p.name for p in output.parent.iterdir()} - {output.name, trace_of(output).name}
        return complaints + ([f"left behind: {sorted(left)}"] if left else [])

"""The programs that are tortured, and what is known of one run of them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from landing_cli.results.output import journal_path
from landing_cli.results.store import read

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PATIENCE_S = 600.0


@dataclass(frozen=True)
class Program:
    """A command that writes a result: the toy of this folder, or the real one.

    Both note in the file TORTURE_TRACE which chunks they begin, and die on the item TORTURE_DEADLY.
    """

    name: str
    words: tuple[str, ...]
    different: tuple[str, ...]  # what makes it another run
    chunk_facets: int

    def command(self, output: Path, backend: str = "threads", jobs: int = 2, *more: str) -> list[str]:
        plan = ["--backend", backend, "--jobs", str(jobs)]
        return [sys.executable, *self.words, "-o", str(output), *plan, *more]


TOY = Program("toy", (str(HERE / "toy_run.py"),), ("--name", "other"), 16)


def reach_run(scenario: str, *sets: str) -> Program:
    """Return ``reach run`` on a scenario, with overrides like ``reach.tof_s=700``."""
    from landing_cli.reach.facet_work import CHUNK_FACETS

    overrides = [word for key in sets for word in ("--set", key)]
    words = (str(HERE / "traced_reach.py"), "run", scenario, *overrides)
    return Program("reach run", words, ("--set", "reach.final_stage_s=190"), CHUNK_FACETS)


def reach_isochrone(scenario: str, *sets: str) -> Program:
    """Return ``reach isochrone`` on a scenario, with overrides like ``isochrone.step_s=10``."""
    from landing_cli.reach.facet_work import CHUNK_FACETS

    overrides = [word for key in sets for word in ("--set", key)]
    words = (str(HERE / "traced_isochrone.py"), "isochrone", scenario, *overrides)
    return Program("reach isochrone", words, ("--set", "reach.final_stage_s=190"), CHUNK_FACETS)


def trace_of(output: Path) -> Path:
    return output.parent.with_name(f"{output.parent.name}.trace")


def environment(**more: str) -> dict[str, str]:
    path = os.pathsep.join([str(HERE), str(ROOT), os.environ.get("PYTHONPATH", "")])
    return {**os.environ, "PYTHONPATH": path, **more}


def note_chunk(key: str) -> None:
    """Note that a chunk is begun, where that is wanted; called by the programs, in whatever process."""
    if trace := os.environ.get("TORTURE_TRACE"):
        descriptor = os.open(trace, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.write(descriptor, f"{key}\n".encode())
        os.close(descriptor)


def die_on(items: Sequence[int]) -> None:
    """Die where the deadly item is among those to solve; called by the programs."""
    if int(os.environ.get("TORTURE_DEADLY", "-1")) in items:
        os.kill(os.getpid(), signal.SIGKILL)


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
    notes: Counter[str] = field(default_factory=Counter)  # how many of which kind

    def record(self, case: str, complaints: Sequence[str]) -> None:
        self.tried += 1
        if complaints:
            self.failures.append(f"{case}: {'; '.join(complaints)}")
            print(f"FAILED {self.name}: {self.failures[-1]}", file=sys.stderr, flush=True)

    @property
    def passed(self) -> int:
        return self.tried - len(self.failures)


@dataclass(frozen=True)
class Reference:
    """The undisturbed run that every disturbed one must equal, and how long one takes."""

    program: Program
    digest: str
    seconds: dict[str, float]
    result: Path

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
        return cls(program, digests.pop(), seconds, output)

    def resumed(
        self, output: Path, backend: str = "threads", variables: Mapping[str, str] | None = None
    ) -> list[str]:
        """Resume a run and say what is wrong with the outcome."""
        from_nothing = not any(path.exists() for path in (output, journal_path(output)))
        ended = finish(self.program.command(output, backend, 2, "--resume"), variables)
        if ended.code != 0:
            return [f"--resume ended with {ended.code}: {ended.stderr.strip()[-200:]}"]
        if from_nothing:  # the machine may be busier, or idler, than it was
            self.seconds[backend] = ended.seconds
        complaints = [] if digest_of(output) == self.digest else ["the resumed result differs"]
        left = {p.name for p in output.parent.iterdir()} - {output.name}
        return complaints + ([f"left behind: {sorted(left)}"] if left else [])

"""The one exception family: what went wrong, where, and how to fix it."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit codes of every command (the contract that scripts rely on)."""

    OK = 0
    BUG = 1
    USAGE = 2
    REFUSED = 3
    NOTHING_FEASIBLE = 4
    VERIFICATION_FAILED = 5
    PARTIAL = 6
    SIGNAL = 128


class LandingError(Exception):
    """An expected failure, told to the user in one message without a traceback.

    Parameters
    ----------
    what : str
        What is wrong, with the value that was found.
    where : str, optional
        File, dotted key, facet or edge at fault.
    fix : str, optional
        What the user can do about it.
    """

    exit_code: ExitCode = ExitCode.REFUSED

    def __init__(self, what: str, *, where: str = "", fix: str = "") -> None:
        super().__init__(what)
        self.what = what
        self.where = where
        self.fix = fix

    def __str__(self) -> str:
        """Return ``where: what; fix`` on one line."""
        head = f"{self.where}: {self.what}" if self.where else self.what
        return f"{head}; {self.fix}" if self.fix else head

    def __reduce__(self) -> tuple[object, ...]:
        """Support pickling across worker processes (keyword-only arguments)."""
        return _rebuild, (type(self), self.what, self.where, self.fix)


def _rebuild(kind: type[LandingError], what: str, where: str, fix: str) -> LandingError:
    return kind(what, where=where, fix=fix)


class UsageError(LandingError):
    """The command line itself is wrong."""

    exit_code = ExitCode.USAGE


class InputRefused(LandingError):
    """A scenario, shape, catalogue, result, or a missing extra is refused."""


class OutputRefused(LandingError):
    """An output path cannot be written, or holds something that must not be lost."""


class NothingFeasible(LandingError):
    """The command ran, but nothing is feasible in any case."""

    exit_code = ExitCode.NOTHING_FEASIBLE


class VerificationFailed(LandingError):
    """A re-flight missed its target or broke a constraint."""

    exit_code = ExitCode.VERIFICATION_FAILED


class PartialResult(LandingError):
    """Some facets were lost to failures; the rest is stored."""

    exit_code = ExitCode.PARTIAL

"""The border of a process: signals, closed streams, and errors that become one message and a code."""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import NoReturn, TextIO

from landing_cli.errors import ExitCode, LandingError, OutputRefused

TRACEBACK_OPTION = "--traceback"
TRACEBACK_VARIABLE = "LANDING_TRACEBACK"
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_PATIENCE_S = 1.5
# what an output path or the machine refuses, as opposed to a mistake of ours
_REFUSED_BY_SYSTEM = {
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EFBIG,
    errno.EROFS,
    errno.EACCES,
    errno.EPERM,
    errno.EIO,
    errno.ENOTDIR,
    errno.EISDIR,
    errno.ENOENT,
    errno.ENAMETOOLONG,
    errno.EMFILE,
    errno.ENOMEM,
}

_resume_hint = ""


class Interrupted(BaseException):
    """The user or the system asked the process to stop."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


class StdoutClosed(Exception):
    """The reader of stdout has gone, as ``head`` does: no mistake of anybody."""


def hint_on_interrupt(text: str) -> None:
    """Say what to add to the one line that an interrupted command leaves.

    Parameters
    ----------
    text : str
        For instance how to continue; empty to add nothing.
    """
    global _resume_hint
    _resume_hint = text


def run_process(command: Callable[[Sequence[str]], int]) -> NoReturn:
    """Run a command as this process: streams made safe, signals caught, and exit.

    Parameters
    ----------
    command : callable
        Takes the arguments, returns the exit code; the heavy imports happen inside it.
    """
    _open_missing_streams()
    if sys.stderr is None:  # it was closed when the interpreter began, and leads to nothing by now
        sys.stderr = open(2, "w", closefd=False, errors="backslashreplace")  # noqa: SIM115
    _catch_signals()
    sys.stdout = _GuardedStdout(sys.stdout)
    try:
        code = told(command, sys.argv[1:])
        for number in _SIGNALS:  # done: the interpreter's end would bring the deadly default back
            signal.signal(number, signal.SIG_IGN)
    except Interrupted as stop:
        _leave(stop.number)
    sys.exit(code)


def told(command: Callable[[Sequence[str]], int], arguments: Sequence[str]) -> int:
    """Run a command and tell its errors in one message each.

    Parameters
    ----------
    command : callable
        Takes the arguments, returns the exit code.
    arguments : sequence of str
        ``--traceback`` among them (or LANDING_TRACEBACK=1) shows where an error came from.

    Returns
    -------
    int
        Exit code.
    """
    show = TRACEBACK_OPTION in arguments or os.environ.get(TRACEBACK_VARIABLE, "0") not in ("", "0")
    arguments = [argument for argument in arguments if argument != TRACEBACK_OPTION]
    try:
        code = command(arguments)
        sys.stdout.flush()
    except StdoutClosed:
        return ExitCode.OK
    except Exception as error:
        if show:
            _print_traceback(error)
        message, code = _message_and_code(error)
        tell(message)
    return code


def tell(message: str) -> None:
    """Write one message to stderr; a stderr that cannot be written is nobody's mistake.

    Parameters
    ----------
    message : str
        Control characters in it (from a file name, a value) are made visible.
    """
    clean = "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in message)
    try:
        sys.stderr.write(f"{clean}\n")
        sys.stderr.flush()
    except (OSError, ValueError, AttributeError):
        pass


def _message_and_code(error: Exception) -> tuple[str, int]:
    if isinstance(error, LandingError):
        return f"error: {error}", error.exit_code
    if isinstance(error, OSError) and error.errno in _REFUSED_BY_SYSTEM:
        if error.filename:
            return f"error: {error.filename}: {error.strerror}", ExitCode.REFUSED
        kernels = os.environ.get("NUMBA_CACHE_DIR", "numba's cache")
        fix = f"if it met the compiled kernels ({kernels}), set NUMBA_CACHE_DIR to another folder"
        return f"error: {error.strerror}; {fix}", ExitCode.REFUSED
    usage = getattr(error, "format_message", None)  # the command-line library's own errors
    if usage is not None:
        text, context = usage(), getattr(error, "ctx", None)
        if text.startswith("Usage:") or context is None:  # a command group without a command shows its help
            return text, ExitCode.USAGE
        return f"error: {text}\nTry '{context.command_path} --help'.", ExitCode.USAGE
    if isinstance(error, MemoryError):
        return "error: out of memory; use fewer jobs, or a smaller shape", ExitCode.BUG
    text = " ".join(str(error).split())[:300]
    return (
        f"error: unexpected {type(error).__name__}: {text}; this is a bug: run again with "
        f"{TRACEBACK_OPTION} and report what it prints, with the scenario",
        ExitCode.BUG,
    )


def _print_traceback(error: Exception) -> None:
    import traceback

    traceback.print_exception(error, file=sys.stderr)


class _GuardedStdout(io.TextIOWrapper):
    """Tell a reader that has gone from a device that is full, whoever writes."""

    def __init__(self, stream: TextIO | None) -> None:
        if isinstance(stream, io.TextIOWrapper):
            raw, encoding, lines = stream.buffer, stream.encoding, stream.line_buffering
        else:  # it was closed, and leads to nothing by now
            raw, encoding, lines = open(1, "wb", closefd=False), "utf-8", False  # noqa: SIM115
        super().__init__(raw, encoding=encoding, errors="backslashreplace", line_buffering=lines)

    def write(self, text: str, /) -> int:
        try:
            return super().write(text)
        except OSError as error:
            raise _stdout_failure(error) from None

    def flush(self) -> None:
        try:
            super().flush()
        except OSError as error:
            raise _stdout_failure(error) from None


def _stdout_failure(error: OSError) -> Exception:
    # what is still buffered must not fail again when the interpreter ends
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.close(null)
    if error.errno == errno.EPIPE:
        return StdoutClosed()
    return OutputRefused(f"cannot be written: {error.strerror}", where="standard output")


def _open_missing_streams() -> None:
    """Open descriptors 0 to 2 on nothing where the caller closed them, before a file takes their number."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)


def _catch_signals() -> None:
    """Turn SIGINT and SIGTERM into an exception, and into an end if compiled code holds it up.

    The interpreter delivers a signal between two bytecodes only; the watchdog reads the byte that
    the C-level handler writes at once.
    """
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    for number in _SIGNALS:
        signal.signal(number, _on_signal)
    sys.unraisablehook = _tell_unraisable
    threading.Thread(target=_watch, args=(reading,), daemon=True, name="signal watchdog").start()


def _on_signal(number: int, frame: object) -> None:
    for caught in _SIGNALS:  # one is enough: a second must not cut the first one's clean-up short
        signal.signal(caught, signal.SIG_IGN)
    raise Interrupted(number)


def _tell_unraisable(raised: sys.UnraisableHookArgs) -> None:
    """Show what could not be raised (in a destructor, say), but an interruption: the watchdog ends that."""
    if not isinstance(raised.exc_value, Interrupted):
        sys.__unraisablehook__(raised)


def _watch(descriptor: int) -> None:
    while True:
        number = os.read(descriptor, 1)[0]
        if number in _SIGNALS:
            time.sleep(_PATIENCE_S)
            _leave(number)


def _leave(number: int) -> NoReturn:
    """Say so and end at once: worker threads and exit hooks would hold the process up."""
    hint = f"; {_resume_hint}" if _resume_hint else ""
    tell(f"interrupted by {signal.Signals(number).name}{hint}")
    os._exit(ExitCode.SIGNAL + number)

"""A signal that arrives where nothing can be raised: the process still ends, in one line."""

from __future__ import annotations

import signal
import subprocess
import sys

COMMAND = """
import os, signal, time
from landing_cli.cli.guard import run_process

class Dying:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGTERM)
        for _ in range(100):
            pass

def command(arguments):
    Dying()
    time.sleep(30)
    return 0

run_process(command)
"""


def test_a_signal_in_a_destructor_ends_the_process_without_a_traceback() -> None:
    ended = subprocess.run([sys.executable, "-c", COMMAND], capture_output=True, text=True, timeout=20)
    assert ended.returncode == 128 + signal.SIGTERM
    assert ended.stderr == "interrupted by SIGTERM\n"

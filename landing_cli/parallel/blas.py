"""One BLAS thread a process: more would fight over the cores and change the order of sums."""

from __future__ import annotations

import os

BLAS_LIBRARIES = ("OMP", "OPENBLAS", "MKL", "BLIS")
BLAS_PINS = {f"{library}_NUM_THREADS": "1" for library in BLAS_LIBRARIES}


def pin_blas_threads() -> None:
    """Set the environment so that BLAS runs one thread in this process and its workers.

    Call it before numpy is first imported; a second thread changes the order of sums.
    """
    os.environ.update(BLAS_PINS)

"""The core's measured peak in float64: fused multiply-adds, scalar and in vectors.

The vector loop runs two Horner chains of DEGREE steps per element, far more arithmetic than memory
traffic, over independent elements that the compiler packs into vectors; the scalar one keeps eight chains
in flight and gives the compiler nothing to pack.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np
from numba import njit

DEGREE = 32
CHAINS = 8
FUSED = {"contract"}


@njit(fastmath=FUSED, error_model="numpy")
def _vector_loop(x, out, repeats):
    for _ in range(repeats):
        for i in range(x.shape[0]):
            t = x[i]
            a = b = out[i]
            for _k in range(DEGREE):
                a = a * t + 0.25
                b = b * t + 0.26
            out[i] = a + b


@njit(fastmath=FUSED, error_model="numpy")
def _scalar_loop(t, repeats):
    a = b = c = d = e = f = g = h = t
    for _ in range(repeats):
        a = a * t + 0.25
        b = b * t + 0.26
        c = c * t + 0.27
        d = d * t + 0.28
        e = e * t + 0.29
        f = f * t + 0.31
        g = g * t + 0.32
        h = h * t + 0.33
    return a + b + c + d + e + f + g + h


def _rate(work: Callable[[], object], flops: float) -> float:
    """Best of five, in flop/s of CPU time."""
    work()
    times = []
    for _ in range(5):
        begun = time.process_time()
        work()
        times.append(time.process_time() - begun)
    return flops / min(times)


def measured_peak() -> tuple[float, float]:
    """Scalar and vector peak of one core, with full optimisation, in a process of its own.

    Returns
    -------
    scalar, vector : float, flop/s
        A fused multiply-add counts as two.
    """
    own = [sys.executable, "-m", "bench.peak"]
    told = subprocess.run(own, env={**os.environ, "NUMBA_OPT": "3"}, capture_output=True, check=True).stdout
    scalar, vector = json.loads(told)
    return scalar, vector


def _measure() -> tuple[float, float]:
    x, out = np.full(256, 0.5), np.zeros(256)
    n, steps = 8_000, 40_000_000
    scalar = _rate(lambda: _scalar_loop(0.5, steps), 2.0 * CHAINS * steps)
    vector = _rate(lambda: _vector_loop(x, out, n), 2.0 * 2 * DEGREE * x.size * n)
    return scalar, vector


if __name__ == "__main__":
    print(json.dumps(_measure()))

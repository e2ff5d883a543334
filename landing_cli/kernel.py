"""How kernels are compiled: cached, without the GIL, with C's division, and without a wrapper for C.

Two traps of numba's: a function is compiled again for each literal argument (pass a variable's value
instead), and optimised again inside each function that calls it. ``inlined`` spares the latter for short
functions with one caller; long ones compile slower inlined.
"""

from __future__ import annotations

from typing import Any

from numba import njit

_njit: Any = njit  # its stubs do not know every option
_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}

kernel = _njit(**_OPTIONS)
inlined = _njit(**_OPTIONS, inline="always")

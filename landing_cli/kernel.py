"""How kernels are compiled: cached, without the GIL, with C's division, and without a wrapper for C.

Two traps of numba's: a function is compiled again for each literal argument, also for a variable that
begins as one (begin with ``np.int64(0)``), and optimised again inside each function that calls it. For short
functions with one caller, ``inlined`` spares the latter; long ones compile slower inlined.
"""

from __future__ import annotations

from typing import Any

from numba import njit

_njit: Any = njit  # its stubs do not know every option
_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}

kernel = _njit(**_OPTIONS)
inlined = _njit(**_OPTIONS, inline="always")
# For kernels that only kernels call: what unboxes large records for Python takes longer than many a kernel.
inner = _njit(**_OPTIONS, no_cpython_wrapper=True)

"""Whether the compiled kernels are in the cache."""

from __future__ import annotations

from typing import Any

from landing_cli.compile_cache import is_cached
from landing_cli.reach.free_batch import solve_many


def are_compiled(descent: str) -> bool:
    """Tell whether a descent's kernel was compiled before, by this version for this kind of processor.

    Parameters
    ----------
    descent : {"free", "extremal"}
        The family of trajectories.
    """
    kernels: list[Any] = [solve_many]
    if descent == "extremal":
        from landing_cli.reach.extremal_descent import search_batch

        kernels.append(search_batch)
    return all(is_cached(kernel) for kernel in kernels)

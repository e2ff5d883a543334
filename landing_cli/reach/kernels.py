"""Whether the compiled kernels are in the cache."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from landing_cli.reach.free_batch import solve_many


def are_compiled() -> bool:
    """Tell whether the facet kernel was compiled before, by this version for this kind of processor."""
    cache: Any = getattr(solve_many, "_cache", None)
    try:
        return Path(cache.cache_path, cache._cache_file._index_name).exists()
    except AttributeError:  # another numba
        return True

"""Fields fitted to polyhedra, kept on disk in the user's cache: a fit takes much longer than reading it.

What is kept is named after the polyhedron, the code that fits and the processor, so that nothing stale is
read; and looked through before kernels read it. Where nothing can be kept, the fit is made anew.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import llvmlite.binding  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.body.gravity import (
    facet_potential,
    field_values,
    fitted_pieces,
    horner,
    point_mass,
    polyhedron,
    polyhedron_records,
    surrounding,
    surrounding_fit,
    surrounding_kernels,
    surrounding_pieces,
)
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.body.gravity.surrounding_checks import is_sound
from landing_cli.sources.whole_file import write_whole

MOST_KEPT = 8  # files, of some tens of megabytes
# whose code decides the numbers
_MAKERS = (
    facet_potential,
    field_values,
    fitted_pieces,
    horner,
    point_mass,
    polyhedron,
    polyhedron_records,
    surrounding,
    surrounding_fit,
    surrounding_kernels,
    surrounding_pieces,
)
_SUFFIX = ".field"
_DIGEST = hashlib.sha256().digest_size


def kept_interpolation(
    vertices: ArrayLike, faces: ArrayLike, before_fit: Callable[[], None] = lambda: None
) -> GravityField:
    """Return the field fitted to a polyhedron of GM = 1 m3/s2.

    Parameters
    ----------
    vertices : (n, 3) float, m, body frame
        As ``polyhedron_field`` takes them.
    faces : (m, 3) int
        0-based vertex indices, counter-clockwise seen from outside.
    before_fit : callable
        Called before what takes a minute, where it is not kept.

    Returns
    -------
    GravityField
        Of the kind ``INTERPOLATED``; from the cache where it lies there. Any number of processors makes the
        same, bit for bit.

    Raises
    ------
    InputRefused
        If the mesh is no body, or has too many facets.
    """
    exact = polyhedron_field(vertices, faces, 1.0)
    folder, name = cache_folder(), _name(exact) + _SUFFIX
    params = _read(folder / name)
    if params is None:
        surrounding.refuse_misfits(exact)
        before_fit()
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            params = surrounding.surrounding_field(exact, pool.map).field.params
        _keep(folder, name, params)
    return GravityField(GravityKind.INTERPOLATED, params)


def is_kept(vertices: ArrayLike, faces: ArrayLike) -> bool:
    """Tell whether a polyhedron's field was fitted before, by this version for this kind of processor."""
    return (cache_folder() / (_name(polyhedron_field(vertices, faces, 1.0)) + _SUFFIX)).exists()


def cache_folder() -> Path:
    """Return where fields are kept: ``landing/fields`` in the user's cache."""
    given = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")  # noqa: PTH111
    return Path(given) / "landing" / "fields"


def _name(exact: GravityField) -> str:
    digest = hashlib.sha256(llvmlite.binding.get_host_cpu_name().encode())
    for module in _MAKERS:
        digest.update(Path(str(module.__file__)).read_bytes())
    digest.update(exact.params.tobytes())
    return digest.hexdigest()[:32]


def _read(path: Path) -> NDArray[np.float64] | None:
    """Read a kept field; None where there is none, or a broken one."""
    try:
        data = path.read_bytes()
        own = path.stat().st_uid == os.geteuid()
    except OSError:
        return None
    if not own or hashlib.sha256(data[_DIGEST:]).digest() != data[:_DIGEST]:
        return None
    params = np.load(io.BytesIO(data[_DIGEST:]), allow_pickle=False)
    return params if params.dtype == np.float64 and params.ndim == 1 and is_sound(params) else None


def _keep(folder: Path, name: str, params: NDArray[np.float64]) -> None:
    """Write a field, and drop the oldest of too many; a cache that cannot be written is none."""
    stream = io.BytesIO()
    np.save(stream, params, allow_pickle=False)
    data = stream.getvalue()
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        write_whole(folder / name, hashlib.sha256(data).digest() + data)
        for old in list(_newest_first(folder))[MOST_KEPT:]:
            old.unlink(missing_ok=True)


def _newest_first(folder: Path) -> Iterator[Path]:
    yield from sorted(folder.glob("*" + _SUFFIX), key=lambda file: file.stat().st_mtime, reverse=True)

"""A tree as the bytes of an HDF5 file, as xarray and netCDF tools read them."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from math import ceil
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from landing_cli.results.tree import Attribute, Dataset, Group, canonical_attribute

CHUNK_BYTES = 1 << 20
NETCDF_DIMENSION = "This is a netCDF dimension but not a netCDF variable. {:9d}"

Scales = Mapping[str, h5py.Dataset]

_TEXT = h5py.h5t.py_create(h5py.string_dtype("utf-8"), logical=True)
_SCALAR = h5py.h5s.create(h5py.h5s.SCALAR)


def build_image(root: Group) -> bytes:
    """Build an HDF5 file in memory: h5py never touches the disk, where a full one would crash it.

    Parameters
    ----------
    root : Group
        The tree, provenance included.

    Returns
    -------
    bytes
        The same for the same tree.
    """
    memory = BytesIO()  # HDF5's own in-memory driver would have to copy the whole file out
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fileobj_driver(h5py.h5fd.fileobj_driver, memory)
    access.set_libver_bounds(h5py.h5f.LIBVER_V18, h5py.h5f.LIBVER_V18)
    creation = h5py.h5p.create(h5py.h5p.FILE_CREATE)
    creation.set_obj_track_times(False)
    identifier = h5py.h5f.create(b"memory", h5py.h5f.ACC_TRUNC, creation, access)
    with h5py.File(identifier) as file:
        _fill(file, root, {})
    return memory.getvalue()


def _fill(place: h5py.Group, group: Group, scales: Scales) -> None:
    for name, value in sorted(group.attributes.items()):
        _set_attribute(place, name, value)
    datasets = {n: m for n, m in sorted(group.members.items()) if isinstance(m, Dataset)}
    made = {name: _create(place, name, dataset) for name, dataset in datasets.items()}
    scales = {**scales, **_scales(place, datasets, made, scales)}
    for name, dataset in datasets.items():
        for axis, dimension in enumerate(dataset.dims):
            h5py.h5ds.set_label(made[name].id, axis, dimension.encode())
            if name != dimension:
                h5py.h5ds.attach_scale(made[name].id, scales[dimension].id, axis)
    creation = h5py.h5p.create(h5py.h5p.GROUP_CREATE)
    creation.set_obj_track_times(False)
    for name, member in sorted(group.members.items()):
        if isinstance(member, Group):
            inner = h5py.Group(h5py.h5g.create(place.id, name.encode(), gcpl=creation))
            _fill(inner, member, scales)


def _create(place: h5py.Group, name: str, dataset: Dataset) -> h5py.Dataset:
    data = _storable(dataset.data)
    # An empty array cannot be chunked, and has nothing to check.
    # Each chunk is written once: a cache of them would only hold every dataset's until the file is closed.
    options: dict[str, Any] = {}
    if data.size:
        options = {"chunks": _chunk_shape(data), "fletcher32": True, "rdcc_nbytes": 0}
    made = place.create_dataset(name, data=data, track_times=False, **options)
    _set_attribute(made, "units", dataset.units)
    _set_attribute(made, "description", dataset.description)
    if dataset.data.dtype.kind == "U":
        _set_attribute(made, "_Encoding", "utf-8")  # or xarray takes words for bytes
    if dataset.flags is not None:
        _put(made, "flag_values", np.array(list(dataset.flags), dtype=data.dtype))
        _set_attribute(made, "flag_meanings", " ".join(dataset.flags.values()))
    return made


def _storable(data: NDArray[Any]) -> NDArray[Any]:
    if data.dtype.kind != "U":
        return data
    encoded = np.char.encode(data, "utf-8")
    return encoded.astype(h5py.string_dtype("utf-8", max(encoded.dtype.itemsize, 1)))


def _chunk_shape(data: NDArray[Any]) -> tuple[int, ...]:
    pieces = max(1, ceil(data.nbytes / CHUNK_BYTES))
    return (max(1, ceil(len(data) / pieces)), *data.shape[1:])


def _scales(
    place: h5py.Group, datasets: Mapping[str, Dataset], made: Scales, outer: Scales
) -> dict[str, h5py.Dataset]:
    """Make the dimension scales that this group needs beyond those of the groups around it."""
    lengths: dict[str, int] = {}
    for name, dataset in datasets.items():
        for dimension, length in zip(dataset.dims, dataset.data.shape, strict=True):
            if lengths.setdefault(dimension, length) != length:
                raise ValueError(
                    f"{place.name}/{name}: dimension {dimension} is {lengths[dimension]} and {length}"
                )
    scales: dict[str, h5py.Dataset] = {}
    for dimension, length in sorted(lengths.items()):
        own = datasets.get(dimension)
        if own is not None:
            if own.dims != (dimension,):
                raise ValueError(f"{place.name}/{dimension} is named like a dimension")
            made[dimension].make_scale(dimension)
            scales[dimension] = made[dimension]
        elif dimension not in outer or len(outer[dimension]) != length:
            scale = place.create_dataset(dimension, shape=(length,), dtype=">f4", track_times=False)
            scale.make_scale(NETCDF_DIMENSION.format(length))
            scales[dimension] = scale
    return scales


def _set_attribute(place: h5py.HLObject, name: str, value: Attribute) -> None:
    value = canonical_attribute(value)
    if isinstance(value, str | tuple):
        _put(place, name, np.array(value, dtype=object), _TEXT)
    else:
        _put(place, name, np.asarray(value))


def _put(place: h5py.HLObject, name: str, array: NDArray[Any], kind: h5py.h5t.TypeID = None) -> None:
    """Create an attribute by the library's own calls; h5py's take three times as long."""
    kind = kind or h5py.h5t.py_create(array.dtype)
    space = h5py.h5s.create_simple(array.shape) if array.shape else _SCALAR
    h5py.h5a.create(place.id, name.encode(), kind, space).write(array)

"""The bytes of an HDF5 file as a tree, trusting nothing in them."""

from __future__ import annotations

from math import prod
from typing import Any

import h5py
import numpy as np

from landing_cli.results.tree import Attribute, Dataset, Group, canonical_attribute

DEEPEST = 12
MOST_OBJECTS = 100_000
LARGEST_ATTRIBUTE_BYTES = 1 << 24
INTERNAL_ATTRIBUTES = {
    "CLASS",
    "NAME",
    "DIMENSION_LIST",
    "REFERENCE_LIST",
    "DIMENSION_LABELS",
    "_Encoding",
}
OWN_ATTRIBUTES = {"units", "description", "flag_values", "flag_meanings"}


class Distrusted(ValueError):
    """The file holds what this program never writes."""


def parse_image(image: bytes) -> Group:
    """Read a whole HDF5 file from memory.

    Parameters
    ----------
    image : bytes
        The file.

    Returns
    -------
    Group
        Its tree, every array checked against its checksum.

    Raises
    ------
    Distrusted
        If it holds links, layouts, filters, types or sizes that this program never writes.
    OSError, RuntimeError, ValueError, KeyError
        If the HDF5 library cannot make sense of it.
    """
    identifier = h5py.h5f.open_file_image(image, h5py.h5f.ACC_RDONLY)
    with h5py.File(identifier) as file:
        return _Parser(len(image)).group(file["/"], "", 0)


class _Parser:
    """One walk through one file, with what it has seen and how much it may still read."""

    def __init__(self, size: int) -> None:
        self._bytes_left = size
        self._seen: set[object] = set()

    def group(self, place: h5py.Group, path: str, depth: int) -> Group:
        self._meet(place, path)
        if depth > DEEPEST:
            raise Distrusted(f"{path}: groups are nested {depth} deep")
        attributes = {name: _attribute(place, name, path) for name in place.attrs}
        members: dict[str, Dataset | Group] = {}
        for raw in place.id:
            name = raw.decode("utf-8")
            here = f"{path}/{name}"
            if place.id.links.get_info(raw).type != h5py.h5l.TYPE_HARD:
                raise Distrusted(f"{here}: is a link to somewhere else")
            member = place[name]
            if isinstance(member, h5py.Group):
                members[name] = self.group(member, here, depth + 1)
            elif isinstance(member, h5py.Dataset):
                dataset = self._dataset(member, here)
                if dataset is not None:
                    members[name] = dataset
            else:
                raise Distrusted(f"{here}: is neither group nor dataset")
        return Group(members, attributes)

    def _meet(self, place: h5py.HLObject, path: str) -> None:
        """Refuse a second way to the same object: a circle of links would never end."""
        info = h5py.h5o.get_info(place.id)
        key = (info.fileno, info.addr)
        if key in self._seen or len(self._seen) >= MOST_OBJECTS:
            raise Distrusted(f"{path}: is linked twice, or there are more than {MOST_OBJECTS} objects")
        self._seen.add(key)

    def _dataset(self, place: h5py.Dataset, path: str) -> Dataset | None:
        self._meet(place, path)
        creation = place.id.get_create_plist()
        layout = creation.get_layout()
        if layout == h5py.h5d.VIRTUAL or creation.get_external_count():
            raise Distrusted(f"{path}: keeps its data in another file")
        size, stored = prod(place.shape or ()) * place.dtype.itemsize, place.id.get_storage_size()
        if place.shape is None or not place.shape:
            raise Distrusted(f"{path}: has no dimensions")
        if _is_bare_dimension(place) and stored == 0:
            return None
        if size:
            filters = [creation.get_filter(i)[0] for i in range(creation.get_nfilters())]
            if layout != h5py.h5d.CHUNKED or filters != [h5py.h5z.FILTER_FLETCHER32]:
                raise Distrusted(f"{path}: has no checksum, or other filters")
            self._bytes_left -= size
            if size > stored or self._bytes_left < 0:
                raise Distrusted(f"{path}: its shape {place.shape} does not fit the file's size")
        return self._described(place, path)

    def _described(self, place: h5py.Dataset, path: str) -> Dataset:
        if place.dtype.kind not in "iufS" or place.dtype.hasobject:
            raise Distrusted(f"{path}: holds {place.dtype}")
        data = place[()]
        if data.dtype.kind == "S":
            data = np.char.decode(data, "utf-8")
        names = set(place.attrs) - INTERNAL_ATTRIBUTES
        if names - OWN_ATTRIBUTES or not {"units", "description"} <= names:
            raise Distrusted(f"{path}: has other attributes than it should")
        told: dict[str, Any] = {name: _attribute(place, name, path) for name in names}
        if not (isinstance(told["units"], str) and isinstance(told["description"], str)):
            raise Distrusted(f"{path}: its unit or description is no text")
        flags = _flags(told.get("flag_values"), told.get("flag_meanings"), path)
        dims = tuple(str(dim.label) for dim in place.dims)
        return Dataset(data, told["units"], told["description"], dims, flags)


def _flags(values: Attribute | None, words: Attribute | None, path: str) -> dict[int, str] | None:
    """What the values of an enumeration mean; None for a plain quantity."""
    if values is None and words is None:
        return None
    if not (isinstance(values, np.ndarray) and values.dtype.kind in "iu" and isinstance(words, str)):
        raise Distrusted(f"{path}: the meanings of its values are of the wrong kind")
    if len(values) != len(words.split()):
        raise Distrusted(f"{path}: has {len(words.split())} meanings for {len(values)} values")
    return dict(zip(values.tolist(), words.split(), strict=True))


def _is_bare_dimension(place: h5py.Dataset) -> bool:
    return place.is_scale and place.dims[0].label == "" and place.dtype == np.dtype(">f4")


def _attribute(place: h5py.HLObject, name: str, path: str) -> Attribute:
    raw = place.attrs.get_id(name)
    kind = raw.get_type().get_class()
    if kind not in (h5py.h5t.STRING, h5py.h5t.INTEGER, h5py.h5t.FLOAT):
        raise Distrusted(f"{path}: attribute {name} is of an unknown kind")
    if raw.get_storage_size() > LARGEST_ATTRIBUTE_BYTES:
        raise Distrusted(f"{path}: attribute {name} is too large")
    value = place.attrs[name]
    if isinstance(value, np.ndarray) and value.dtype.kind in "OS":
        return tuple(str(text) for text in value.tolist())
    return canonical_attribute(value)

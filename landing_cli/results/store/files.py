"""Result files: written whole or not at all, sealed, and checked before they are believed."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from landing_cli.errors import InputRefused
from landing_cli.results.disk import begins_with, read_whole, replace_file
from landing_cli.results.identity import SCHEMA_VERSION, RunIdentity
from landing_cli.results.tree import Attribute, Group, digest

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
PROVENANCE = "provenance"
DIGEST = "digest_sha256"
_SEAL_TEXT = b"\nlanding result, sha256 of all before: "
_SEAL_BYTES = len(_SEAL_TEXT) + 64 + 1


@dataclass(frozen=True, eq=False)
class StoredResult:
    """A result as it was read.

    Attributes
    ----------
    path : Path
    tree : Group
        Everything but the provenance; its attributes are those of the file's root.
    provenance : mapping
        How, when and where the file was made.
    digest : str
        SHA-256 over ``tree``: equal for equal results.
    """

    path: Path
    tree: Group
    provenance: Mapping[str, Attribute]
    digest: str

    @property
    def mission(self) -> str:
        """Which mission wrote it."""
        return str(self.tree.attributes.get("mission", ""))

    @property
    def identity(self) -> RunIdentity:
        """Which run it is the result of."""
        try:
            return RunIdentity.from_dict(dict(self.tree.attributes))
        except ValueError as error:
            raise _refused(self.path, f"does not say which run it is of: {error}") from error

    @property
    def complete(self) -> bool:
        """Whether every part of the run succeeded."""
        return bool(self.tree.attributes.get("complete", 0))


def write(
    path: Path, tree: Group, root_attributes: Mapping[str, Attribute], provenance: Mapping[str, Attribute]
) -> str:
    """Write a result whole, or not at all.

    Parameters
    ----------
    path : Path
        Where; what is there is replaced in one step. The caller holds the output's lock.
    tree : Group
        What to store.
    root_attributes : mapping
        Mission and identity of the run (``RunIdentity.as_dict``), and ``complete``.
    provenance : mapping
        How, when and where it was made; stored under ``/provenance``, outside the digest.

    Returns
    -------
    str
        The digest.

    Raises
    ------
    OutputRefused
        If it cannot be written; what was there before stays.
    """
    from landing_cli.results.store.image import build_image

    if PROVENANCE in tree.members:
        raise ValueError("the provenance is given apart")
    attributes = {"schema_version": SCHEMA_VERSION, **tree.attributes, **root_attributes}
    fingerprint = digest(Group(tree.members, attributes))
    members = {**tree.members, PROVENANCE: Group({}, provenance)}
    image = build_image(Group(members, {**attributes, DIGEST: fingerprint}))
    replace_file(path, image, _seal(image))
    return fingerprint


def read(path: Path) -> StoredResult:
    """Read a result and check it: seal, structure, checksums and digest.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    StoredResult

    Raises
    ------
    InputRefused
        If it is anything but an intact result of a known schema version.
    """
    from landing_cli.results.store.parse import Distrusted, parse_image

    if not begins_with(path, HDF5_SIGNATURE):  # gigabytes of something else are not worth reading
        raise _refused(path, "is no HDF5 file")
    image = _unsealed(path, read_whole(path))
    try:
        root = parse_image(image)
    except Distrusted as error:
        raise _refused(path, str(error)) from error
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, MemoryError, RecursionError) as error:
        raise _refused(path, f"cannot be read as HDF5: {error}") from error
    attributes = dict(root.attributes)
    version = attributes.get("schema_version")
    if type(version) is not int or version != SCHEMA_VERSION:
        told = f"is of schema version {version}, and this program reads {SCHEMA_VERSION}"
        raise InputRefused(told, where=str(path), fix="use the version of the program that wrote it")
    if type(attributes.get("complete", 0)) is not int:
        raise _refused(path, "does not say whether it is complete")
    stated = attributes.pop(DIGEST, None)
    provenance = root.members.get(PROVENANCE, Group())
    tree = Group({n: m for n, m in root.members.items() if n != PROVENANCE}, attributes)
    if stated != digest(tree) or not isinstance(provenance, Group):
        raise _refused(path, "its content does not fit its digest")
    return StoredResult(path, tree, provenance.attributes, str(stated))


def is_result(path: Path) -> bool:
    """Return whether a file bears the marks of a result, intact or not.

    Parameters
    ----------
    path : Path
        The file.
    """
    return begins_with(path, HDF5_SIGNATURE) and _SEAL_TEXT in read_whole(path)[-2 * _SEAL_BYTES :]


def _seal(image: bytes | memoryview) -> bytes:
    return _SEAL_TEXT + hashlib.sha256(image).hexdigest().encode() + b"\n"


def _unsealed(path: Path, data: bytes) -> bytes:
    image, seal = data[:-_SEAL_BYTES], data[-_SEAL_BYTES:]
    if not seal.startswith(_SEAL_TEXT):
        raise _refused(path, "has no seal at its end: cut short, or written by another program")
    if seal != _seal(image):
        raise _refused(path, "has been damaged or changed since it was written: its seal does not fit")
    return image


def _refused(path: Path, what: str) -> InputRefused:
    return InputRefused(what, where=str(path), fix="take an intact copy, or run again")

"""Results as HDF5 files: built in memory, written whole, sealed, and read with distrust.

A file is an HDF5 image and a seal at its end, the SHA-256 of every byte before. HDF5 readers pass
over it; we check it before the HDF5 library sees a byte, because a flipped bit can crash it.
"""

from landing_cli.results.store.files import StoredResult, is_result, read, write

__all__ = ["StoredResult", "is_result", "read", "write"]

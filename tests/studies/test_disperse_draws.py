"""Draws depend on the seed and the sample alone, are normal, and have the covariance that was asked for."""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
import pytest
from dispersion_samples import spread
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import chi2, kstest

from landing_cli.scenario.schema_disperse import DisperseSection
from landing_cli.studies.disperse import draws
from landing_cli.studies.disperse.draws import deviations, standard_normals


def random_covariance(seed: int = 0, rank: int = 6) -> np.ndarray:
    """A covariance of position (tens of metres) and velocity (centimetres a second)."""
    scale = np.array([12.0, 8.0, 5.0, 0.01, 0.02, 0.03])
    half = np.random.default_rng(seed).normal(size=(6, rank)) * scale[:, None]
    return half @ half.T


def factor_of(covariance: np.ndarray) -> np.ndarray:
    rows = tuple(tuple(row) for row in covariance.tolist())
    return np.array(DisperseSection(covariance=rows).state_factor())


def test_the_first_hundred_of_a_thousand_are_those_of_a_run_of_a_hundred() -> None:
    few, many = standard_normals(1, 100), standard_normals(1, 1000)
    assert_array_equal(few, many[:100])
    wide = spread(state_factor=factor_of(random_covariance()), mass_sigma_kg=3.0)
    assert_array_equal(deviations(wide, few), deviations(wide, many)[:100])
    assert not np.isclose(standard_normals(2, 100), few).any()
    assert len(np.unique(many)) == many.size


def test_a_sample_is_the_spawned_stream_of_its_number() -> None:
    """Numpy's own children of the seed, and the normal distribution of the standard library."""
    children = np.random.SeedSequence(1).spawn(8)
    for sample, child in enumerate(children):
        raw = np.random.Philox(child).random_raw(9)
        shares = [((int(word) >> 12) + 0.5) / 2**52 for word in raw]
        known = [NormalDist().inv_cdf(share) for share in shares]
        assert_allclose(standard_normals(1, 8)[sample], known, rtol=1e-9, atol=1e-12)


def test_draws_are_standard_normal_and_independent() -> None:
    normals = standard_normals(3, 4000)
    assert kstest(normals.ravel(), "norm").pvalue > 0.01
    for column in normals.T:
        assert kstest(column, "norm").pvalue > 1e-3
    correlation = np.corrcoef(normals.T)
    assert np.abs(correlation - np.eye(9)).max() < 4.0 / np.sqrt(4000)
    after = np.corrcoef(normals[:-1].ravel(), normals[1:].ravel())[0, 1]
    assert abs(after) < 4.0 / np.sqrt(9 * 4000)


@pytest.mark.parametrize("word", [0, 2**64 - 1])
def test_no_draw_is_infinite_or_beyond_what_sigmas_allow(word: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(draws, "_raw", lambda seed, sample: np.full(9, word, dtype=np.uint64))
    assert_allclose(np.abs(standard_normals(1, 1)), 8.21, atol=0.01)


@pytest.mark.parametrize("rank", [6, 4, 1])
def test_deviations_have_the_covariance_that_was_given(rank: int) -> None:
    covariance = random_covariance(rank=rank)
    factor = factor_of(covariance)
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert_allclose(factor @ factor.T / scale, covariance / scale, atol=1e-7)
    assert_array_equal(factor, np.tril(factor))
    drawn = deviations(spread(state_factor=factor), standard_normals(1, 3000))
    assert_allclose(np.cov(drawn[:, :6].T) / scale, covariance / scale, atol=5.0 / np.sqrt(3000))
    assert_array_equal(drawn[:, 6:], 0.0)
    if rank == 6:  # squared lengths in the covariance's own metric
        lengths = np.einsum("ij,jk,ik->i", drawn[:, :6], np.linalg.inv(covariance), drawn[:, :6])
        assert kstest(lengths, chi2(6).cdf).pvalue > 0.01


def test_sigmas_are_those_of_the_quantities() -> None:
    wide = spread(
        state_factor=factor_of(random_covariance()),
        mass_sigma_kg=3.0,
        thrust_sigma_n=0.4,
        gm_sigma_m3_s2=0.05,
    )
    assert_allclose(wide.sigmas[:6], np.sqrt(np.diag(random_covariance())), rtol=1e-12)
    assert_allclose(wide.sigmas[6:], [3.0, 0.4, 0.05], rtol=1e-15)
    drawn = deviations(wide, standard_normals(5, 3000))
    assert_allclose(drawn.std(axis=0), wide.sigmas, rtol=5.0 / np.sqrt(2 * 3000))

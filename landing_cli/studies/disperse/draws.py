"""Draws that depend on the seed and the sample alone.

Each sample has a counter-based generator of its own (Philox, keyed by numpy's SeedSequence with the sample as
spawn key), so that the first hundred of a thousand samples are those of a run of a hundred. Its raw stream,
which numpy keeps the same for ever, is turned into normals by the inverse of their distribution; numpy's own
normals may change from version to version.
"""

from __future__ import annotations

import numpy as np

from landing_cli.studies.disperse.records import DRAWN, FloatArray, Spread

# One less than a double holds: with the half added, no share rounds up to 1.
_BITS = 52


def standard_normals(seed: int, samples: int) -> FloatArray:
    """Draw standard normals.

    Parameters
    ----------
    seed : int
        Not negative.
    samples : int
        How many samples; more of them leave the first ones as they are.

    Returns
    -------
    (samples, 9) float
        None farther from zero than 8.3.
    """
    from scipy.special import ndtri

    raw = np.stack([_raw(seed, sample) for sample in range(samples)])
    shares = ((raw >> np.uint64(64 - _BITS)).astype(np.float64) + 0.5) * 2.0**-_BITS
    return np.asarray(ndtri(shares))


def _raw(seed: int, sample: int) -> np.ndarray[tuple[int], np.dtype[np.uint64]]:
    sequence = np.random.SeedSequence(seed, spawn_key=(sample,))
    return np.asarray(np.random.Philox(sequence).random_raw(DRAWN), dtype=np.uint64)


def deviations(spread: Spread, normals: FloatArray) -> FloatArray:
    """Turn standard normals into deviations.

    Parameters
    ----------
    spread : Spread
        How the start is dispersed.
    normals : (n, 9) float
        From :func:`standard_normals`.

    Returns
    -------
    (n, 9) float, SI
        Of position and velocity along the spread's axes, mass, thrust and GM.
    """
    factor = spread.factor
    # sample by sample: a product of matrices may round a row by how many there are
    return np.array([factor @ row for row in normals])

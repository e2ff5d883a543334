"""Gravity models handed to kernels: by kind, in any thread and process."""

from __future__ import annotations

import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from gravity_helpers import FIELDS, points_around
from numba.core.errors import TypingError

from landing_cli.body.gravity import models
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.field_values import accelerations
from landing_cli.body.gravity.harmonics import harmonics_acceleration
from landing_cli.body.gravity.kernels import acceleration
from landing_cli.kernel import kernel

POINT = points_around(400.0, 1)[0]
HARMONICS = FIELDS["harmonics"]


@kernel
def number_in_a_kernel(kind: GravityKind) -> int:
    return models.number_of(kind)


def test_a_kernel_calls_the_models_own_function() -> None:
    params = HARMONICS.params.copy()
    assert acceleration(HARMONICS.kind, params, *POINT) == harmonics_acceleration(params, *POINT)
    assert acceleration(HARMONICS.kind, HARMONICS.params, *POINT) == harmonics_acceleration(params, *POINT)


def test_one_compiled_kernel_serves_every_model() -> None:
    before = len(number_in_a_kernel.signatures)
    assert [number_in_a_kernel(kind) for kind in GravityKind] == [kind.value for kind in GravityKind]
    assert len(number_in_a_kernel.signatures) - before <= 1


def test_a_plain_number_is_no_kind() -> None:
    with pytest.raises(TypingError):
        acceleration(1, HARMONICS.params, *POINT)


def test_a_kind_is_looked_up_anew_by_threads_that_come_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = acceleration(HARMONICS.kind, HARMONICS.params, *POINT)
    monkeypatch.setattr(models, "_rows", {})
    with ThreadPoolExecutor(8) as pool:
        asked = [pool.submit(acceleration, HARMONICS.kind, HARMONICS.params, *POINT) for _ in range(64)]
    assert {answer.result() for answer in asked} == {expected}


def test_what_goes_wrong_in_a_compilation_is_raised_at_the_call(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(models, "_rows", {})
    monkeypatch.setattr(models, "_compiled", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        acceleration(HARMONICS.kind, HARMONICS.params, *POINT)


def test_a_field_is_pickled_by_its_kind_and_works_in_another_process() -> None:
    """No address of this process goes along."""
    asked = pickle.dumps((HARMONICS, POINT))
    assert isinstance(pickle.loads(asked)[0], GravityField)
    code = (
        "import pickle, sys\n"
        "field, point = pickle.loads(sys.stdin.buffer.read())\n"
        "from landing_cli.body.gravity.field_values import accelerations\n"
        "sys.stdout.write(accelerations(field, point).tobytes().hex())\n"
    )
    told = subprocess.run([sys.executable, "-c", code], input=asked, capture_output=True, check=True).stdout
    found = np.frombuffer(bytes.fromhex(told.decode()))
    np.testing.assert_array_equal(found, accelerations(HARMONICS, POINT).ravel())

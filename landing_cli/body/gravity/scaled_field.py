"""The same body with another mass: every gravity model is linear in GM, and keeps its shape."""

from __future__ import annotations

from landing_cli.body.gravity.checks import checked_number
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.kernel_types import FloatArray
from landing_cli.body.gravity.surrounding_kernels import GM

_DENSITY = 2  # where a polyhedron's parameters hold G rho
_MASSES = [0, 3]  # where a dipole's hold GM of either mass


def scaled_field(field: GravityField, factor: float) -> GravityField:
    """Scale a field's GM.

    Parameters
    ----------
    field : GravityField
        Of any model.
    factor : float
        Of GM; 1 gives the same parameters, bit for bit.

    Returns
    -------
    GravityField
        Potential, acceleration and all derivatives times the factor, everywhere: the harmonics'
        coefficients, the dipole's masses and the polyhedron's shape stay in proportion.

    Raises
    ------
    InputRefused
        The factor is not positive and finite.
    """
    share = checked_number("factor of GM", factor, above=0.0)
    params = field.params.copy()
    if field.kind is GravityKind.DIPOLE:
        params[_MASSES] *= share
    elif field.kind is GravityKind.POLYHEDRON:
        params[_DENSITY] *= share
    elif field.kind is GravityKind.BOXED or field.kind is GravityKind.INTERPOLATED:
        _scale_interpolated(params, share)
        if field.kind is GravityKind.INTERPOLATED:
            params[GM] *= share
    else:
        params *= share  # GM, and GM R^2 times the coefficients
    return GravityField(field.kind, params)


def _scale_interpolated(params: FloatArray, share: float) -> None:
    """The polynomials' coefficients, and the polyhedron behind them: both kinds say alike where they are."""
    polyhedron, coefficients = int(params[0]), int(params[1])
    params[coefficients:polyhedron] *= share
    params[polyhedron + _DENSITY] *= share

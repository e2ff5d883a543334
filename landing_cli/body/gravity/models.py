"""Gravity models as functions that kernels are handed: each compiles by itself, once, where it is first used.

To a kernel, a ``GravityKind`` is the address of a row: the kind's number and the addresses of the model's
four compiled functions, called as numba calls its own. So no kernel holds a model's code: it neither compiles
it again nor answers for models that nobody asks for. A kind that comes in from Python is looked up there and
then, in every process on its own; only kinds travel between processes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import extending, types
from numba.core import cgutils

from landing_cli.body.gravity.boxed_kernels import (
    boxed_acceleration,
    boxed_acceleration_and_gradient,
    boxed_curvature,
    boxed_potential,
)
from landing_cli.body.gravity.dipole import (
    dipole_acceleration,
    dipole_acceleration_and_gradient,
    dipole_curvature,
    dipole_potential,
)
from landing_cli.body.gravity.field import GravityKind
from landing_cli.body.gravity.harmonics import (
    harmonics_acceleration,
    harmonics_acceleration_and_gradient,
    harmonics_curvature,
    harmonics_potential,
)
from landing_cli.body.gravity.kernel_types import FloatArray
from landing_cli.body.gravity.point_mass import (
    point_mass_acceleration,
    point_mass_acceleration_and_gradient,
    point_mass_curvature,
    point_mass_potential,
)
from landing_cli.body.gravity.polyhedron import (
    polyhedron_acceleration,
    polyhedron_acceleration_and_gradient,
    polyhedron_curvature,
    polyhedron_potential,
)
from landing_cli.body.gravity.surrounding_kernels import (
    surrounding_acceleration,
    surrounding_acceleration_and_gradient,
    surrounding_curvature,
    surrounding_potential,
)

# numba's own functions are not typed
_types: Any = types
_extending: Any = extending
_cgutils: Any = cgutils
_PrimitiveModel: Any = extending.models.PrimitiveModel

NUMBER, POTENTIAL, ACCELERATION, ACCELERATION_AND_GRADIENT, CURVATURE = range(5)  # places in a row

_MODELS: dict[GravityKind, tuple[Any, ...]] = {
    GravityKind.POINT_MASS: (
        point_mass_potential,
        point_mass_acceleration,
        point_mass_acceleration_and_gradient,
        point_mass_curvature,
    ),
    GravityKind.HARMONICS: (
        harmonics_potential,
        harmonics_acceleration,
        harmonics_acceleration_and_gradient,
        harmonics_curvature,
    ),
    GravityKind.DIPOLE: (
        dipole_potential,
        dipole_acceleration,
        dipole_acceleration_and_gradient,
        dipole_curvature,
    ),
    GravityKind.POLYHEDRON: (
        polyhedron_potential,
        polyhedron_acceleration,
        polyhedron_acceleration_and_gradient,
        polyhedron_curvature,
    ),
    GravityKind.BOXED: (
        boxed_potential,
        boxed_acceleration,
        boxed_acceleration_and_gradient,
        boxed_curvature,
    ),
    GravityKind.INTERPOLATED: (
        surrounding_potential,
        surrounding_acceleration,
        surrounding_acceleration_and_gradient,
        surrounding_curvature,
    ),
}

_real, _address = types.float64, ir.IntType(64)
_params = _types.Array(_real, 1, "C")
_numbers, _results = (0, 3, 3, 3, 6), (0, _real, *(_types.UniTuple(_real, n) for n in (3, 9, 6)))
_rows: dict[GravityKind, FloatArray] = {}


def compile_model(kind: GravityKind) -> int:
    """Make sure that a model's functions are compiled, here or in the cache on disk.

    Parameters
    ----------
    kind : GravityKind
        The model.

    Returns
    -------
    int
        Address of its row, which stays for good.
    """
    row = _rows.get(kind)
    if row is None:
        addresses = [_compiled(f, n) for f, n in zip(_MODELS[kind], _numbers[1:], strict=True)]
        row = _rows.setdefault(kind, np.array([kind.value, *addresses], dtype=np.int64))
    return int(row.ctypes.data)


def _compiled(function: Any, numbers: int) -> int:
    arguments = (_params, *(_real,) * numbers)
    function.compile(arguments)
    compiled = function.overloads[arguments]
    return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))


class _ModelType(types.Type):
    def __init__(self) -> None:
        super().__init__("GravityModel")


_model_type = _ModelType()


@_extending.typeof_impl.register(GravityKind)
def _typeof_kind(_kind: GravityKind, _context: Any) -> _ModelType:
    return _model_type


@_extending.register_model(_ModelType)
class _ModelModel(_PrimitiveModel):  # type: ignore[misc]
    """The row's address."""

    def __init__(self, manager: Any, model: _ModelType) -> None:
        super().__init__(manager, model, _address)


@_extending.unbox(_ModelType)
def _unbox_kind(_model: _ModelType, value: Any, c: Any) -> Any:
    """Look the kind's row up; what goes wrong in a compilation is raised at the call."""
    look_up = c.pyapi.unserialize(c.pyapi.serialize_object(compile_model))
    number = c.pyapi.call_function_objargs(look_up, (value,))
    c.pyapi.decref(look_up)
    address = _cgutils.alloca_once_value(c.builder, ir.Constant(_address, 0))
    with c.builder.if_then(_cgutils.is_not_null(c.builder, number)):
        c.builder.store(c.pyapi.long_as_longlong(number), address)
        c.pyapi.decref(number)
    return _extending.NativeValue(c.builder.load(address), is_error=_cgutils.is_null(c.builder, number))


def _load(builder: Any, row: Any, place: int) -> Any:
    words = builder.inttoptr(row, _address.as_pointer())
    return builder.load(_cgutils.gep_inbounds(builder, words, place))


def called(place: int) -> Any:
    """Return what calls a function of a row from a kernel: ``f(kind, params, numbers...)``.

    Parameters
    ----------
    place : int
        The function's place in the row. Its result is a number, or a tuple of them.

    Returns
    -------
    intrinsic
        It takes read-only parameters as others: no model writes them.
    """
    arguments, result = (_params, *(_real,) * _numbers[place]), _results[place]

    def call(_context: Any, kind: Any, params: Any, *numbers: Any) -> Any:
        flat = isinstance(params, types.Array) and (params.ndim, params.layout) == (1, "C")
        if not isinstance(kind, _ModelType) or not flat or params.dtype != _real:
            return None
        return result(kind, params, *arguments[1:]), generate

    def generate(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        function = context.call_conv.get_function_type(result, arguments)
        pointer = builder.inttoptr(_load(builder, values[0], place), function.as_pointer())
        # no model raises: its status is always that all is well
        return context.call_conv.call_function(builder, pointer, result, arguments, values[1:])[1]

    if _numbers[place] == 3:

        @_extending.intrinsic
        def at_point(context: Any, kind: Any, params: Any, x: Any, y: Any, z: Any) -> Any:
            return call(context, kind, params, x, y, z)

        return at_point

    @_extending.intrinsic
    def along(context: Any, kind: Any, params: Any, x: Any, y: Any, z: Any, lx: Any, ly: Any, lz: Any) -> Any:
        return call(context, kind, params, x, y, z, lx, ly, lz)

    return along


@_extending.intrinsic
def number_of(_context: Any, kind: Any) -> Any:
    """Return the number of the kind that a kernel was handed."""
    if not isinstance(kind, _ModelType):
        return None

    def generate(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return _load(builder, values[0], NUMBER)

    return types.int64(kind), generate

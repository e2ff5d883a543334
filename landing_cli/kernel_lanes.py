"""Several problems solved at once: numbers that hold one value a problem, side by side in a vector register.

To a kernel, an element of a ``LaneArray`` is WIDTH numbers, one a lane, on which arithmetic and comparisons
work lane by lane. Kernels that are written with :func:`choose` where they would branch take plain numbers and
lanes alike. No operation mixes lanes, so what comes out of one does not depend on the others. Products and
sums are rounded one by one, as plain numbers are: fused, they would depend on how a compiler arranges code.
"""

from __future__ import annotations

import math
import operator
from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import extending, types
from numba.core import cgutils, typeconv
from numba.core.typing import templates
from numpy.typing import NDArray

from landing_cli.kernel_outline import own_function

# numba's own functions are not typed
_types: Any = types
_typeconv: Any = typeconv
_extending: Any = extending
_cgutils: Any = cgutils
_Concrete: Any = templates.ConcreteTemplate
_PrimitiveModel: Any = extending.models.PrimitiveModel
_signature: Any = templates.signature
_infer_global: Any = templates.infer_global

WIDTH = 4
_ALIGNMENT = 64

_real = _types.float64
_word = ir.IntType(32)
_vector, _bits = ir.VectorType(ir.DoubleType(), WIDTH), ir.VectorType(ir.IntType(1), WIDTH)


class _LanesType(types.Type):
    """WIDTH numbers; a plain number becomes as many equal ones."""

    def __init__(self) -> None:
        super().__init__(f"Lanes({WIDTH})")

    def can_convert_from(self, _context: Any, other: Any) -> Any:
        """Tell that plain numbers convert."""
        return _typeconv.Conversion.safe if isinstance(other, types.Float | types.Integer) else None

    def unify(self, _context: Any, other: Any) -> Any:
        """Unify with plain numbers."""
        return self if isinstance(other, types.Float | types.Integer) else None


class _MaskType(types.Type):
    """WIDTH truth values."""

    def __init__(self) -> None:
        super().__init__(f"Mask({WIDTH})")


lanes, mask = _LanesType(), _MaskType()


@_extending.register_model(_LanesType)
class _LanesModel(_PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _vector)


@_extending.register_model(_MaskType)
class _MaskModel(_PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _bits)


class LaneArray(np.ndarray[Any, Any]):
    """An array whose elements are lanes: WIDTH float64 each."""


@_extending.typeof_impl.register(LaneArray)
def _typeof_lane_array(value: LaneArray, _context: Any) -> Any:
    return _types.Array(lanes, value.ndim, "C")


def new_lanes(shape: int | tuple[int, ...]) -> Any:
    """Return a zeroed LaneArray, aligned as vector loads want it."""
    sizes = (shape,) if isinstance(shape, int) else shape
    size = 8 * WIDTH * math.prod(sizes)
    room = np.zeros(size + _ALIGNMENT, dtype=np.uint8)
    first = -room.ctypes.data % _ALIGNMENT
    return room[first : first + size].view(f"V{8 * WIDTH}").reshape(sizes).view(LaneArray)


def by_lane(array: LaneArray) -> NDArray[np.float64]:
    """Return the same memory as plain numbers, (..., WIDTH)."""
    return np.asarray(array).view(np.float64).reshape(*array.shape, WIDTH)


def _splat(builder: Any, value: Any) -> Any:
    one = builder.insert_element(ir.Constant(_vector, ir.Undefined), value, ir.Constant(_word, 0))
    return builder.shuffle_vector(
        one, ir.Constant(_vector, ir.Undefined), ir.Constant(ir.VectorType(_word, WIDTH), [0] * WIDTH)
    )


@_extending.lower_cast(types.Float, _LanesType)
@_extending.lower_cast(types.Integer, _LanesType)
def _widen(context: Any, builder: Any, kind: Any, _to: Any, value: Any) -> Any:
    return _splat(builder, context.cast(builder, value, kind, _real))


def _operation(function: Any, result: Any, build: Any, arguments: int = 2, of: Any = lanes) -> None:
    """Teach numba a function of lanes, mixed with plain numbers too."""
    kinds: list[tuple[Any, ...]] = [(of,) * arguments]
    if arguments == 2 and of is lanes:
        kinds += [(lanes, _real), (_real, lanes)]

    cases = [_signature(result, *pair) for pair in kinds]
    _infer_global(function)(type("Lanes", (_Concrete,), {"cases": cases}))

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        wide = [context.cast(builder, v, t, of) for v, t in zip(values, signature.args, strict=True)]
        return build(builder, *wide)

    for pair in kinds:
        _extending.lower_builtin(function, *pair)(lower)


def _greater(builder: Any, a: Any, b: Any) -> Any:
    return builder.select(builder.fcmp_ordered(">", a, b), a, b)


def _less(builder: Any, a: Any, b: Any) -> Any:
    return builder.select(builder.fcmp_ordered("<", a, b), a, b)


def _call(name: str) -> Any:
    def build(builder: Any, a: Any) -> Any:
        kind = ir.FunctionType(_vector, [_vector])
        function = _cgutils.get_or_insert_function(builder.module, kind, f"{name}.v{WIDTH}f64")
        return builder.call(function, [a])

    return build


for _function, _name in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul")):
    _operation(_function, lanes, lambda b, x, y, name=_name: getattr(b, name)(x, y))
    _inplace = getattr(operator, "i" + _function.__name__)
    _operation(_inplace, lanes, lambda b, x, y, name=_name: getattr(b, name)(x, y))
_operation(operator.truediv, lanes, lambda b, x, y: b.fdiv(x, y))
_operation(operator.itruediv, lanes, lambda b, x, y: b.fdiv(x, y))
_operation(operator.neg, lanes, lambda b, x: b.fneg(x), 1)
for _function, _name in ((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">=")):
    _operation(_function, mask, lambda b, x, y, name=_name: b.fcmp_ordered(name, x, y))
_operation(operator.and_, mask, lambda b, x, y: b.and_(x, y), of=mask)
_operation(operator.or_, mask, lambda b, x, y: b.or_(x, y), of=mask)
_operation(max, lanes, _greater)
_operation(min, lanes, _less)
_operation(abs, lanes, _call("llvm.fabs"), 1)
_operation(math.sqrt, lanes, _call("llvm.sqrt"), 1)
_operation(math.exp, lanes, _call("llvm.exp"), 1)


@_extending.intrinsic
def choose(_context: Any, where: Any, a: Any, b: Any) -> Any:
    """Return a where the condition holds, else b: in every lane, or for plain numbers."""
    wide = lanes in (a, b) or where == mask
    result = lanes if wide else _real

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        x, y = (context.cast(builder, values[i], signature.args[i], result) for i in (1, 2))
        return builder.select(values[0], x, y)

    return result(where, a, b), generate


@_extending.intrinsic
def any_lane(_context: Any, where: Any) -> Any:
    """Tell whether a condition holds in any lane."""

    def generate(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        if where != mask:
            return values[0]
        word = builder.bitcast(values[0], ir.IntType(WIDTH))
        return builder.icmp_unsigned("!=", word, ir.Constant(ir.IntType(WIDTH), 0))

    return types.boolean(where), generate


@_extending.intrinsic
def lane(_context: Any, value: Any, place: Any) -> Any:
    """Return the number in one lane; a plain number is the same in all."""

    def generate(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return builder.extract_element(*values) if value == lanes else values[0]

    return _real(value, place), generate


@_extending.intrinsic
def with_lane(_context: Any, value: Any, place: Any, number: Any) -> Any:
    """Return lanes with the number in one of them changed."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        scalar = context.cast(builder, values[2], signature.args[2], _real)
        return builder.insert_element(values[0], scalar, values[1])

    return lanes(lanes, place, number), generate


def _address(context: Any, builder: Any, kind: Any, array: Any, row: Any, column: Any) -> Any:
    """Where a row's element lies, for the row's number as a float."""
    view = context.make_array(kind)(context, builder, array)
    place = builder.fptosi(row, ir.IntType(64))
    if kind.ndim == 2:
        width = _cgutils.unpack_tuple(builder, view.shape, 2)[1]
        place = builder.add(builder.mul(place, width), column)
    return builder.bitcast(builder.gep(view.data, [place]), ir.DoubleType().as_pointer())


@_extending.intrinsic
def at_rows(_context: Any, array: Any, row: Any, column: Any) -> Any:
    """Return array[row, column], or array[row], for a row's number of each lane's own, as a float."""
    wide = row == lanes

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        column_ = context.cast(builder, values[2], signature.args[2], types.int64)
        if not wide:
            return builder.load(_address(context, builder, array, values[0], values[1], column_))
        out = ir.Constant(_vector, ir.Undefined)
        for k in range(WIDTH):
            place = ir.Constant(_word, k)
            own = builder.extract_element(values[1], place)
            address = _address(context, builder, array, values[0], own, column_)
            if array.dtype == lanes:
                address = builder.gep(address, [place])
            out = builder.insert_element(out, builder.load(address), place)
        return out

    return (lanes(array, lanes, column) if wide else _real(array, _real, column)), generate


@_extending.intrinsic
def add_at_rows(_context: Any, array: Any, row: Any, column: Any, value: Any) -> Any:
    """Add to array[row, column] for a row's number of each lane's own, as a float."""
    wide = array.dtype == lanes

    def add(builder: Any, address: Any, number: Any) -> None:
        builder.store(builder.fadd(builder.load(address), number), address)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        column_ = context.cast(builder, values[2], signature.args[2], types.int64)
        if not wide:
            add(builder, _address(context, builder, array, values[0], values[1], column_), values[3])
            return context.get_dummy_value()
        for k in range(WIDTH):
            place = ir.Constant(_word, k)
            own = builder.extract_element(values[1], place)
            address = _address(context, builder, array, values[0], own, column_)
            number = builder.extract_element(values[3], place)
            add(builder, builder.gep(address, [place]), number)
        return context.get_dummy_value()

    kinds = (lanes, column, lanes) if wide else (_real, column, _real)
    return _types.void(array, *kinds), generate


def _lane_copier(reads: bool) -> Any:
    """Return what copies all numbers of one lane between a LaneArray and a plain array of its shape."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        number = ir.DoubleType().as_pointer()
        places, sizes = [], []
        for kind, value in ((signature.args[0], values[0]), (signature.args[2], values[2])):
            view = context.make_array(kind)(context, builder, value)
            places.append(builder.bitcast(view.data, number))
            size = ir.Constant(ir.IntType(64), 1)
            for extent in _cgutils.unpack_tuple(builder, view.shape, kind.ndim):
                size = builder.mul(size, extent)
            sizes.append(size)
        shorter = builder.select(builder.icmp_signed("<", *sizes), *sizes)
        arguments = places[0], places[1], values[1], shorter
        signature = ir.FunctionType(ir.VoidType(), [argument.type for argument in arguments])
        builder.call(own_function(context, builder, ("lane", reads), signature, loop), arguments)
        return context.get_dummy_value()

    def loop(_context: Any, builder: Any, wide: Any, plain: Any, place: Any, size: Any) -> None:
        with _cgutils.for_range(builder, size) as each:
            number = builder.add(builder.mul(each.index, ir.Constant(ir.IntType(64), WIDTH)), place)
            of_lane, of_plain = builder.gep(wide, [number]), builder.gep(plain, [each.index])
            source, target = (of_lane, of_plain) if reads else (of_plain, of_lane)
            builder.store(builder.load(source), target)

    def copy(_context: Any, array: Any, place: Any, plain: Any) -> Any:
        fits = array.dtype == lanes and plain.dtype == _real and array.layout == plain.layout == "C"
        return (_types.void(array, types.int64, plain), generate) if fits else None

    return copy


@_extending.intrinsic
def take_lane(context: Any, array: Any, place: Any, plain: Any) -> Any:
    """Copy one lane of an array to a plain one, in C order, up to the end of the shorter one."""
    return _lane_copier(True)(context, array, place, plain)


@_extending.intrinsic
def put_lane(context: Any, array: Any, place: Any, plain: Any) -> Any:
    """Copy a plain array to one lane of an array, in C order, up to the end of the shorter one."""
    return _lane_copier(False)(context, array, place, plain)

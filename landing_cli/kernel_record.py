"""Records that kernels are handed by reference.

numba passes a NamedTuple by value, each array in it as eight numbers, and takes it apart and together again
at every call and every field: with dozens of arrays that is most of what a compilation costs. A class marked
``by_reference`` reaches a kernel, and each kernel that one calls, as one pointer to its fields. Kernels read
the fields and write into the arrays. They cannot make such a record, nor return it or an array of it: both
are lent without a count of references and live as long as the call from Python.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import extending, types
from numba.core import cgutils
from numba.core.typing import templates

from landing_cli.kernel_outline import own_function

# numba's own functions are not typed
_types: Any = types
_extending: Any = extending
_cgutils: Any = cgutils
_Template: Any = templates.AttributeTemplate
_PointerModel: Any = extending.models.PointerModel

Class = TypeVar("Class", bound=type)


class RecordType(types.Type):
    """A record of one class, with the types of its fields."""

    def __init__(self, record: type, fields: tuple[Any, ...]) -> None:
        self.record, self.fields = record, _types.NamedTuple(fields, record)
        super().__init__(f"Record({self.fields.name})")

    @property
    def key(self) -> Any:
        """What makes two record types the same."""
        return self.fields


def by_reference(record: Class) -> Class:
    """Let kernels take a NamedTuple class by reference."""
    known: dict[Any, RecordType] = {}

    @_extending.typeof_impl.register(record)
    def typeof_record(value: Any, context: Any) -> RecordType:
        # every call from Python asks; numba would look at dozens of arrays
        key = _typed_by(value, context)
        if key not in known:
            known[key] = RecordType(record, tuple(_extending.typeof_impl(field, context) for field in value))
        return known[key]

    return record


def _typed_by(value: Any, context: Any) -> Any:
    """Return what numba's type of a value depends on, or that type itself."""
    kind = type(value)
    if isinstance(value, np.ndarray):
        return kind, value.dtype, value.ndim, value.flags.num
    if isinstance(value, tuple):
        return kind, *(_typed_by(field, context) for field in value)
    if kind is int:
        return kind, -(2**63) <= value < 2**63
    if kind in (float, bool) or isinstance(value, np.generic):
        return kind
    return _extending.typeof_impl(value, context)


def always_alike(record: Class) -> Class:
    """By reference, for a class whose records all hold the same types: they are looked up once."""
    by_reference(record)
    look_up = _extending.typeof_impl.dispatch(record)
    known: list[RecordType] = []

    @_extending.typeof_impl.register(record)
    def typeof_alike(value: Any, context: Any) -> RecordType:
        if not known:
            known.append(look_up(value, context))
        return known[0]

    return record


@_extending.register_model(RecordType)
class _RecordModel(_PointerModel):  # type: ignore[misc]
    """A pointer to the fields, which lie in the frame of the call from Python."""

    def __init__(self, manager: Any, record: RecordType) -> None:
        super().__init__(manager, _types.CPointer(record.fields))


@_extending.infer_getattr
class _RecordFields(_Template):  # type: ignore[misc]
    key = RecordType

    def generic_resolve(self, record: Any, name: Any) -> Any:
        """Type of a field."""
        if name in record.fields.fields:
            return record.fields.types[record.fields.fields.index(name)]
        return None


@_extending.lower_getattr_generic(RecordType)
def _load_field(context: Any, builder: Any, record: RecordType, pointer: Any, name: str) -> Any:
    """Load one field from where it lies."""
    place = record.fields.fields.index(name)
    model = context.data_model_manager[record.fields.types[place]]
    value: Any = model.load_from_data_pointer(builder, _cgutils.gep_inbounds(builder, pointer, 0, place))
    if isinstance(record.fields.types[place], types.Array):
        array = context.make_array(record.fields.types[place])(context, builder, value)
        array.meminfo = _cgutils.get_null_value(array.meminfo.type)
        value = array._getvalue()
    return value


def _unbox_array(context: Any, builder: Any, kind: Any, value: Any, place: Any) -> Any:
    """Unbox an array to where it shall lie; tell whether that failed."""

    def build(context: Any, builder: Any, value: Any, place: Any) -> Any:
        native = context.get_python_api(builder).to_native_value(kind, value)
        builder.store(context.data_model_manager[kind].as_data(builder, native.value), place)
        return native.is_error

    signature = ir.FunctionType(ir.IntType(1), [value.type, place.type])
    return builder.call(own_function(context, builder, kind, signature, build), [value, place])


def _give_back(context: Any, builder: Any, record: RecordType, place: Any) -> None:
    """Drop what unboxing the fields took: a pointer has no count of references of its own."""

    def build(context: Any, builder: Any, place: Any) -> None:
        for i, kind in enumerate(record.fields.types):
            where = _cgutils.gep_inbounds(builder, place, 0, i)
            value = context.data_model_manager[kind].load_from_data_pointer(builder, where)
            if isinstance(kind, RecordType):
                _give_back(context, builder, kind, value)
            else:
                context.nrt.decref(builder, kind, value)

    signature = ir.FunctionType(ir.VoidType(), [place.type])
    builder.call(own_function(context, builder, record, signature, build), [place])


@_extending.unbox(RecordType)
def _unbox_record(record: RecordType, value: Any, c: Any) -> Any:
    """Unbox the fields into the frame of the call."""
    models, failed = c.context.data_model_manager, _cgutils.false_bit
    place = _cgutils.alloca_once(c.builder, models[record.fields].get_data_type())
    for i, kind in enumerate(record.fields.types):
        field, where = c.pyapi.tuple_getitem(value, i), _cgutils.gep_inbounds(c.builder, place, 0, i)
        if isinstance(kind, types.Array):
            refused = _unbox_array(c.context, c.builder, kind, field, where)
        else:
            native = c.unbox(kind, field)
            if native.cleanup is not None and not isinstance(kind, RecordType):
                raise NotImplementedError(f"a field of {kind}")
            c.builder.store(models[kind].as_data(c.builder, native.value), where)
            refused = native.is_error
        failed = c.builder.or_(failed, refused)
    return _extending.NativeValue(
        place, is_error=failed, cleanup=lambda: _give_back(c.context, c.builder, record, place)
    )

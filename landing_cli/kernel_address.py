"""Kernels that others call by their machine code's address.

A kernel that calls another by name holds a copy of its code: it cannot be compiled before the other is, and
all that code is optimised twice. A ``Callee`` is the other kernel as an argument, so that both are compiled
side by side. Its address is looked up in the process that calls, and goes into no cache.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numba
from llvmlite import ir  # type: ignore[import-untyped]
from numba import extending, types
from numba.core import cgutils, errors
from numba.core.compiler_lock import global_compiler_lock
from numba.core.typing import templates

# numba's own functions are not typed
_typeof: Any = numba.typeof
_types: Any = types
_extending: Any = extending
_cgutils: Any = cgutils
_compiler_lock: Any = global_compiler_lock
_signature: Any = templates.signature
_PrimitiveModel: Any = extending.models.PrimitiveModel
_TypingError: Any = errors.TypingError

_address = ir.IntType(64)


class CalleeType(types.Type):
    """What a callee takes and returns; other kernels of the same types are the same to its callers."""

    def __init__(self, name: str, result: Any, arguments: tuple[Any, ...]) -> None:
        self.result, self.arguments = result, arguments
        super().__init__(f"Callee({name})")

    @property
    def key(self) -> Any:
        """What makes two callees' types the same."""
        return self.result, self.arguments


class Callee:
    """A kernel for one kind of arguments, compiled when a kernel is first called with it.

    Parameters
    ----------
    kernel : dispatcher
        What ``kernel`` or ``inner`` made.
    result : numba type
        What it returns.
    *arguments : object
        Arguments of the kind that it will take.
    """

    def __init__(self, kernel: Any, result: Any, *arguments: object) -> None:
        self._kernel = kernel
        self.kind = CalleeType(kernel.__name__, result, tuple(_typeof(argument) for argument in arguments))

    def compile(self) -> Any:
        """Return what numba knows of the compiled kernel."""
        return self._kernel.get_compile_result(_signature(None, *self.kind.arguments))

    @cached_property
    def address(self) -> int:
        """Where its machine code lies in this process."""
        compiled = self.compile()
        if compiled.signature.return_type != self.kind.result:
            raise TypeError(f"{self._kernel.__name__} returns {compiled.signature.return_type}")
        with _compiler_lock:
            place = int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))
        if place == 0:
            raise TypeError(f"{self._kernel.__name__} has no machine code of its own")
        return place

    def __reduce__(self) -> Any:
        """Refuse to be pickled: another process has the code elsewhere."""
        raise TypeError(f"the address of {self._kernel.__name__} holds in this process only")


@_extending.typeof_impl.register(Callee)
def _typeof_callee(callee: Callee, _context: Any) -> CalleeType:
    return callee.kind


@_extending.register_model(CalleeType)
class _CalleeModel(_PrimitiveModel):  # type: ignore[misc]
    """The address."""

    def __init__(self, manager: Any, callee: CalleeType) -> None:
        super().__init__(manager, callee, _address)


@_extending.unbox(CalleeType)
def _unbox_callee(_callee: CalleeType, value: Any, c: Any) -> Any:
    """Ask for the address; what that raises is raised by the call."""
    address = c.pyapi.object_getattr_string(value, "address")
    found = c.builder.icmp_unsigned("!=", address, address.type(None))
    place = _cgutils.alloca_once_value(c.builder, _address(0))
    with c.builder.if_then(found):
        c.builder.store(c.pyapi.long_as_longlong(address), place)
        c.pyapi.decref(address)
    return _extending.NativeValue(c.builder.load(place), is_error=c.builder.not_(found))


@_extending.intrinsic
def call(_context: Any, callee: Any, arguments: Any) -> Any:
    """Call a callee with a tuple of arguments of its own types and no others: nothing is converted."""
    if not isinstance(callee, CalleeType) or not isinstance(arguments, _types.BaseTuple):
        return None
    if tuple(arguments.types) != callee.arguments:
        raise _TypingError(f"{callee} takes {callee.arguments}, not {tuple(arguments.types)}")

    def generate(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        convention = context.call_conv
        function = convention.get_function_type(callee.result, callee.arguments)
        pointer = builder.inttoptr(values[0], function.as_pointer())
        given = [builder.extract_value(values[1], i) for i in range(len(callee.arguments))]
        status, result = convention.call_function(builder, pointer, callee.result, callee.arguments, given)
        with builder.if_then(status.is_error, likely=False):
            convention.return_status_propagate(builder, status)
        return result

    return callee.result(callee, arguments), generate

"""How kernels are compiled: without the GIL, with C's division, and no more often than their callers need.

``kernel`` is for what Python calls: cached on disk. ``part`` is for what only kernels call: it is typed and
translated once, but optimised and made machine code with its callers alone, which takes a fifth off the first
compilation. ``inner`` is for a large part that a process of its own compiles, and that kernels call by its
address (see `kernel_address`). ``inlined`` spares a short function with one caller its translation too; long
ones compile slower inlined.

A trap of numba's: a function is compiled again for each literal argument, also for a variable that begins as
one (begin with ``np.int64(0)``).
"""

from __future__ import annotations

import gc
from typing import Any

from numba import njit
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import LoweringPass, register_pass
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import NativeLowering
from numba.core.types.functions import BaseFunction

# numba's own classes and functions are not typed
_njit: Any = njit
_Library: Any = JITCodeLibrary
_Pass: Any = LoweringPass
_Compiler: Any = CompilerBase
_Flags: Any = Flags
_Function: Any = BaseFunction
_Stack: Any = ConfigStack
_register_pass: Any = register_pass
_PassBuilder: Any = DefaultPassBuilder


class _OwnLibrary(_Library):  # type: ignore[misc]
    """Machine code optimised once: numba's other pass serves counts of references, which kernels have not."""

    def _optimize_final_module(self) -> None:
        passes, timer = self._codegen._module_pass_manager()
        passes.run(self._final_module, timer)


class _PartLibrary(_Library):  # type: ignore[misc]
    """Code to link into callers, neither optimised by itself nor made machine code."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class _BeginLibrary(_Pass):  # type: ignore[misc]
    """Give a function its library before numba gives it the usual one."""

    _library: Any
    _for_python: bool

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        state.library = self._library(state.targetctx.codegen(), state.func_id.func_qualname)
        if self._for_python:
            state.library.enable_object_caching()
        state.flags.no_compile = not self._for_python
        return True


@_register_pass(mutates_CFG=False, analysis_only=True)
class _BeginKernel(_BeginLibrary):
    _name, _library, _for_python = "begin_kernel", _OwnLibrary, True


@_register_pass(mutates_CFG=False, analysis_only=True)
class _BeginPart(_BeginLibrary):
    _name, _library, _for_python = "begin_part", _PartLibrary, False


@_register_pass(mutates_CFG=True, analysis_only=False)
class _EndPart(_Pass):  # type: ignore[misc]
    """Make a part known to its callers."""

    _name = "end_part"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        # numba tells functions apart by what Python calls: here, by what raises a KeyError with these words
        refusal = f"{{{state.func_id.func_qualname} can be called by kernels only}}".format
        state["cr"] = state["cr"]._replace(cfunc=refusal)
        state.targetctx.insert_user_function(refusal, state["cr"].fndesc, [state.library])
        return True


def _pipeline(state: Any, begin: Any) -> Any:
    passes = _PassBuilder.define_nopython_pipeline(state)
    before = [entry[0] for entry in passes.passes].index(NativeLowering) - 1
    passes.add_pass_after(begin, passes.passes[before][0])
    return passes


class _OwnFlags(_Flags):  # type: ignore[misc]
    """Numba's flags, compared by what is set: it does so at each operator, option by option."""

    __slots__ = ()

    def __hash__(self) -> int:
        return hash(frozenset(self._values))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _OwnFlags) and bool(self._values == other._values)


_call_type = _Function.get_call_type
_call_types: dict[Any, Any] = {}


def _remembered_call_type(function: Any, context: Any, args: Any, kws: Any) -> Any:
    """Tell how one of numba's operators is called: it tries all that it knows, in order, each time."""
    flags = _Stack.top_or_none()
    if not isinstance(flags, _OwnFlags):
        return _call_type(function, context, args, kws)
    key = function, context, flags, tuple(args), tuple(kws.items() if kws else ())
    if key not in _call_types:
        signature = _call_type(function, context, args, kws)
        _call_types[key] = signature, function.get_impl_key(signature)
    signature, implementation = _call_types[key]
    # another caller, with other flags, may have left another there
    function._impl_keys[signature.args] = implementation
    return signature


class _OwnCompiler(_Compiler):  # type: ignore[misc]
    """What spares numba most of its typing, a fifth of a compilation, and Python its looks for garbage."""

    def __init__(self, *pieces: Any) -> None:
        *usual, flags, names = pieces
        super().__init__(*usual, _OwnFlags(flags), names)

    def _compile_core(self) -> Any:
        # numba's lock is held; a kernel compiles others meanwhile
        outer, collects = _Function.get_call_type, gc.isenabled()
        _Function.get_call_type = _remembered_call_type
        gc.disable()  # looking for garbage among what numba makes, and keeps, takes a seventh of the time
        try:
            return super()._compile_core()
        finally:
            _Function.get_call_type = outer
            if collects:
                gc.enable()


class _KernelCompiler(_OwnCompiler):
    def define_pipelines(self) -> list[Any]:
        passes = _pipeline(self.state, _BeginKernel)
        passes.finalize()
        return [passes]


class _PartCompiler(_OwnCompiler):
    def define_pipelines(self) -> list[Any]:
        passes = _pipeline(self.state, _BeginPart)
        passes.add_pass_after(_EndPart, NativeLowering)
        passes.finalize()
        return [passes]


_OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}

kernel = _njit(**_OPTIONS, cache=True, pipeline_class=_KernelCompiler)
part = _njit(**_OPTIONS, no_cpython_wrapper=True, pipeline_class=_PartCompiler)
inner = _njit(**_OPTIONS, cache=True, no_cpython_wrapper=True, pipeline_class=_KernelCompiler)
inlined = _njit(**_OPTIONS, inline="always")

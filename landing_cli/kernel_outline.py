"""Code that numba would write into a kernel at each use: written once, as a function that is called.

What Python calls takes a hundred arrays apart, and lanes are copied at dozens of places. Inlined, that is
most of what LLVM has to read, optimise and emit.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]


def own_function(context: Any, builder: Any, key: Any, signature: Any, build: Any) -> Any:
    """Return a function of the builder's module, built at its first use.

    Parameters
    ----------
    context, builder : numba context, llvmlite IRBuilder
        Of the caller.
    key : object
        What tells it from the module's other functions.
    signature : llvmlite FunctionType
        Its arguments and result.
    build : callable
        Told (context, builder, *arguments); returns what the function does.
    """
    known = builder.module.__dict__.setdefault("own_functions", {})
    if key not in known:
        function = known[key] = ir.Function(builder.module, signature, f"own.{len(known)}")
        function.linkage = "internal"
        function.attributes.add("noinline")
        inside = ir.IRBuilder(function.append_basic_block())
        result = build(context, inside, *function.args)
        inside.ret_void() if result is None else inside.ret(result)
    return known[key]

"""Kernels that other kernels call where they are, not as a copy of their code.

Numba compiles a kernel into each that calls it: a step in one kernel would compile all others once
more. A call here jumps to the machine code that Python's calls use, which a `table` lists.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.jit.compile import IS_COMPILING, cgutils, intrinsic, types


def serial(kernel: Any) -> Any:
    """The version of a kernel, on threads or not, that runs on one thread."""
    return getattr(kernel, "alone", kernel)


def table(kernels: Sequence[Any]) -> NDArray[np.int64]:
    """Marks and addresses of all that is compiled of some kernels so far, shape ``(k, 2)``.

    What Python has called on several threads is compiled for one, too.
    """
    rows = []
    for kernel in kernels if IS_COMPILING else ():
        alone = serial(kernel)
        for kinds in getattr(kernel, "on_threads", alone).signatures:
            alone.compile(kinds)
        for compiled in alone.overloads.values():
            name = compiled.fndesc.llvm_func_name
            address = compiled.library.get_pointer_to_function(name)
            rows.append((_mark(alone, compiled.signature), address))
    return np.array(rows or [(0, 0)], np.int64)


def _mark(kernel: Any, signature: Any) -> int:
    """What a kernel for arguments of some kinds is known by: another is not to be called."""
    return zlib.crc32(f"{kernel.py_func.__module__}.{kernel.py_func.__name__}{signature}".encode())


def _address(kernels: NDArray[np.int64], mark: int) -> int:
    for k in range(kernels.shape[0]):
        if kernels[k, 0] == mark:
            return kernels[k, 1]  # type: ignore[no-any-return]
    return 0


@intrinsic
def _jump(typing: Any, kernel: Any, kernels: Any, arguments: Any) -> Any:
    """Numba's part of `call`: the kinds of all, and what writes the code."""
    kind = kernel.get_call_type(typing, arguments.types, {})
    mark = types.int64(_mark(kernel.dispatcher, kind))

    def write(context: Any, builder: Any, _: Any, values: Any) -> Any:
        constant = context.get_constant(types.int64, mark)
        address = context.compile_internal(
            builder, _address, types.int64(kernels, types.int64), (values[1], constant)
        )
        with builder.if_then(builder.icmp_signed("==", address, address.type(0)), likely=False):
            reason = f"{kernel.dispatcher.py_func.__name__} is not compiled for these arguments"
            context.call_conv.return_user_exc(builder, LookupError, (reason,))
        function = context.call_conv.get_function_type(kind.return_type, kind.args)
        given = (
            context.cast(builder, builder.extract_value(values[2], k), has, wanted)
            for k, (has, wanted) in enumerate(zip(arguments.types, kind.args, strict=True))
        )
        status, result = context.call_conv.call_function(
            builder, builder.inttoptr(address, function.as_pointer()), kind.return_type, kind.args,
            list(given),
        )  # fmt: skip
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        return result

    return kind.return_type(kernel, kernels, arguments), write


def _interpreted(kernel: Any, kernels: NDArray[np.int64], arguments: tuple[Any, ...]) -> Any:
    return kernel(*arguments)


call: Any = _jump if IS_COMPILING else _interpreted
"""``call(kernel, table, (arguments, …))``: a kernel called from another.

Raises:
    LookupError: If Python has not called it with arguments of these kinds when the `table` was
        made.
"""

"""The decorators of all kernels: cached, IEEE arithmetic (no fastmath), 1/0 gives inf."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar

from multicor_cli.arithmetic import elementary
from multicor_cli.engine.jit.cache import configure_cache, prefer_openmp, require_layer
from multicor_cli.engine.jit.formulas import compile_with
from multicor_cli.engine.jit.threads import threads_in_use

configure_cache()
prefer_openmp()

import numba  # noqa: E402  (the cache directory and the threading layer must be set first)
import numpy as np  # noqa: E402
from numba.core import cgutils as cgutils  # noqa: E402  (for `vectors`, which must not import Numba before)
from numba.core import types as types  # noqa: E402
from numba.core.registry import CPUDispatcher  # noqa: E402
from numba.extending import intrinsic as intrinsic  # noqa: E402
from numba.extending import register_jitable  # noqa: E402

from multicor_cli.model.model import Floats  # noqa: E402

require_layer()


def _without_scipy() -> None:
    """Load what Numba knows of arrays, but not SciPy, in which it looks for products of matrices.

    It would with its first kernel, for a fifth of a second. No kernel here multiplies matrices; for
    those of others Numba looks again.
    """
    import numba.np.linalg

    products: Any = numba.np.linalg
    look = products.ensure_blas
    products.ensure_blas = lambda: None
    try:
        import numba.np.arraymath
    finally:
        products.ensure_blas = look


_without_scipy()


def _from_the_start() -> None:
    """Let indices that are computed count from the start of an array, as all of ours do.

    Numba would ask each whether it is negative and counts from the end: a tenth of a step, as it
    keeps loops from becoming vectors. A single one that is written as a number still may, as in
    ``start[-1]``. ``NUMBA_BOUNDSCHECK=1`` finds one that is computed and negative. (A Numba that
    asks elsewhere goes on asking: nothing but time is lost.)
    """
    import numba.np.arrayobj as arrays
    from llvmlite import ir

    if not hasattr(arrays, "fix_integer_index"):
        return
    from_either_end = arrays.fix_integer_index

    def from_the_start(context: Any, builder: Any, kind: Any, index: Any, size: Any) -> Any:
        if isinstance(index, ir.Constant):
            return from_either_end(context, builder, kind, index, size)
        return context.cast(builder, index, kind, types.intp)

    arrays.fix_integer_index = from_the_start


_from_the_start()

F = TypeVar("F", bound=Callable[..., Any])

_WITHOUT_COUNTING: dict[str, Any] = {"_nrt": False}  # known to Numba, not to its stubs
# no second copy of a kernel for callers in C: there are none
_NO_C: dict[str, Any] = {"no_cfunc_wrapper": True}

prange = numba.prange

IS_COMPILING = not numba.config.DISABLE_JIT  # type: ignore[attr-defined]
"""Whether kernels are compiled; with ``NUMBA_DISABLE_JIT`` Python runs them."""


def _inlined(function: Callable[..., Any]) -> None:
    """Let kernels call a formula.

    Inlining is forced: LLVM otherwise leaves a call with some thirty arguments in the innermost
    loop, at three times its cost. It must not allocate: Numba then need not count references to the
    arrays of its arguments (an atomic addition for each array that is taken out of a tuple, which
    made the kernels over pairs 2 to 7 times slower).
    """
    register_jitable(error_model="numpy", forceinline=True, **_NO_C, **_WITHOUT_COUNTING)(function)


# Elementary functions know nothing of kernels, and are too long to be inlined everywhere.
for _function in vars(elementary).values():
    if inspect.isfunction(_function):
        register_jitable(error_model="numpy", **_NO_C)(_function)
compile_with(_inlined)


class _Kernel(CPUDispatcher):
    """A kernel, compiled once for all numbers: Numba would for each that is written in a call."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        named = {name: types.unliteral(kind) for name, kind in kws.items()}
        return super().get_call_template(tuple(map(types.unliteral, args)), named)


def _compiled(function: F, dispatcher: type[CPUDispatcher], **options: Any) -> F:
    compiled: Any = numba.njit(cache=True, error_model="numpy", **_NO_C, **options)(function)
    if IS_COMPILING:
        compiled.__class__ = dispatcher
    return compiled  # type: ignore[no-any-return]


def kernel(function: F) -> F:
    """Compile a serial kernel."""
    return _compiled(function, _Kernel)


def threaded_loop(function: F) -> F:
    """Compile a kernel whose ``prange`` loops run on several threads, for other kernels to call."""
    return _compiled(function, _Kernel, parallel=True)


def parallel_kernel(function: F) -> F:
    """Compile a kernel with ``prange`` loops on threads twice, each version when first needed.

    The one for a single thread compiles in half the time, and small problems need no other. Both
    compute the same bits, and call the same version of other such kernels. Where the one for
    several is there it serves a single thread as well.
    """
    alone = kernel(_twin(function, "alone"))
    on_threads = threaded_loop(_twin(function, "on_threads"))
    has_threads = False

    @functools.wraps(function)
    def call(*args: Any) -> Any:
        nonlocal has_threads
        has_threads = has_threads or threads_in_use() > 1
        return (on_threads if has_threads else alone)(*args)

    call.alone, call.on_threads = alone, on_threads  # type: ignore[attr-defined]
    return call  # type: ignore[return-value]


def _twin(function: Callable[..., Any], version: str) -> Callable[..., Any]:
    """A copy that calls this version of the kernels on threads that it names."""
    named = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    chosen = {name: getattr(one, version) for name, one in named.items() if hasattr(one, version)}
    names = {**function.__globals__, **chosen} if chosen else function.__globals__
    twin = FunctionType(
        function.__code__, names, function.__name__, function.__defaults__, function.__closure__
    )
    # Numba's cache knows functions by their names alone
    suffix = "" if version == "alone" else f"_{version}"
    twin.__qualname__, twin.__doc__ = function.__qualname__ + suffix, function.__doc__
    twin.__module__, twin.__annotations__ = function.__module__, function.__annotations__
    return twin


class _ForKernels(_Kernel):
    """What kernels alone call. Numba would crash where Python does, as there is no entry for it."""

    def __call__(self, *_: Any, **__: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} is for kernels alone: call it from one")


class _Subroutine(_ForKernels):
    def get_call_template(self, args: Any, kws: Any) -> Any:
        return super().get_call_template(
            tuple(map(_wide, args)), {name: _wide(kind) for name, kind in kws.items()}
        )


def _wide(kind: Any) -> Any:
    """The kind that an integer argument of a subroutine gets; other kinds as they are."""
    return types.int64 if isinstance(kind, types.Integer) else kind


def _for_kernels(function: F, dispatcher: type[_ForKernels], **options: Any) -> F:
    """Compile without an entry for Python, which takes a seventh of all compilation."""
    return _compiled(function, dispatcher, no_cpython_wrapper=True, **options, **_WITHOUT_COUNTING)


def subroutine(function: F) -> F:
    """Compile a function that kernels call, too long to be inlined; it must not allocate.

    Then references to the arrays of its arguments need not be counted (as `_inlined` says).
    Integers are of one kind, whichever they are where it is called: it would be compiled for each.
    """
    return _for_kernels(function, _Subroutine)


def inlined(function: F) -> F:
    """Compile a `subroutine` into its callers: one that does less than it costs to call it.

    A scene and pieces are more than a hundred numbers, and each call writes and reads them all.
    """
    return _for_kernels(function, _Subroutine, forceinline=True)


def loop_body(function: F) -> F:
    """Compile an inner loop into its kernels; as a `formula` it makes the solve a fifth longer."""
    return _for_kernels(function, _ForKernels, forceinline=True)


def elementwise(function: Callable[[float], float]) -> Callable[[Floats], Floats]:
    """A function of arrays of any shape from one of numbers, compiled when it is first called.

    (A plain loop compiles, and loads from the cache, ten times faster than ``numba.vectorize``.)
    """

    @kernel
    def loop(values: Floats, out: Floats) -> None:
        for k in range(values.size):
            out[k] = function(values[k])

    def apply(values: Floats) -> Floats:
        out = np.empty(values.size)
        loop(np.ascontiguousarray(values).reshape(-1), out)
        return out.reshape(values.shape)

    return apply

"""What reaches a state is computed with operations that every machine rounds alike: a walk over the
code finds every other call.

IEEE 754 fixes + − × ÷ √, comparisons, rounding to integers, and splitting a number into fraction
and exponent. `MATH` and `NUMPY` list what of ``math`` and of NumPy does nothing else, or only moves
and compares values. Everything that is not listed is refused: a function that is missing here is
looked up first, and added only if its definition leaves no choice to the library.
"""

import ast

import pytest
from places import ROOT

PACKAGE = ROOT / "multicor_cli"
WALKED = ("arithmetic", "engine", "model", "packing", "running", "scenario", "store")
"""Packages that make a `Model`, a `State` or what is written of them."""


def _words(text):
    return set(text.split())


# Fsum rounds once; factorial, prod: of integers
MATH = _words("ceil copysign factorial floor frexp fsum inf isfinite isnan ldexp nan pi prod sqrt")
TYPES = _words(
    "bool_ bytes_ dtype float64 generic int8 int32 int64 ndarray record uint8 uint32 uint64 void "
    "inf nan newaxis pi"
)
LAYOUT = _words(
    """append arange array asarray ascontiguousarray atleast_1d column_stack concatenate empty
    errstate fill_diagonal full load loadtxt meshgrid ones ones_like repeat reshape roll
    savez_compressed stack tile tril_indices where zeros zeros_like"""
)
ROUNDED_ONCE = _words(
    "abs add allclose clip diff divmod floor frexp isfinite isnan ldexp maximum minimum nextafter "
    "ptp rint signbit sqrt"
)
IN_ORDER = _words("bincount cumsum maximum.at")  # defined as one value after the other
COMPARING = _words(
    """all argmax argmin argsort argwhere array_equal count_nonzero flatnonzero isin lexsort nanmax
    partition searchsorted sort unique"""
)
OF_INTEGERS = {"prod"}
# Raw numbers, which NumPy promises for all versions
RANDOM = {"random.BitGenerator", "random.Philox", "random.SeedSequence"}
NUMPY = TYPES | LAYOUT | ROUNDED_ONCE | IN_ORDER | COMPARING | OF_INTEGERS | RANDOM

SUMS = {"sum", "mean", "std", "var", "dot", "prod", "trace", "average", "cumprod", "round"}
"""Methods of arrays whose order of operations is the library's."""

_WRITTEN = "sum((math.ceil(count / stage.{}_every) for count, stage in counts))"
INTEGERS = {
    "shape.prod(axis=1)", "lengths.sum()", "lines.sum()", "rows.lines.sum()", "counts.sum()",
    "counts[start:stop].sum()", "sum(known)", *map(_WRITTEN.format, ("frame", "series")),
}  # fmt: skip
"""Sums and products of integers."""

ARRAYS_IN_TURN = {
    "sum((w * (rate.nodes + power) for w, rate in zip(weights, self._rates, strict=False)))"
}
"""Arrays added one after the other: Python's sum of numbers is compensated since 3.12, that of
arrays is not."""

LISTED = INTEGERS | ARRAYS_IN_TURN
STRANGERS = ("cmath", "random", "scipy", "statistics")
COUNTING = ("scenario", "store")
"""Packages whose built-in sums count rows and bytes."""


def dotted(node):
    """The name of an attribute of an attribute of a name; empty for attributes of anything else."""
    if isinstance(node, ast.Name):
        return node.id
    inner = dotted(node.value) if isinstance(node, ast.Attribute) else ""
    return f"{inner}.{node.attr}" if inner else ""


def is_literal(node):
    return isinstance(node.operand if isinstance(node, ast.UnaryOp) else node, ast.Constant)


def strange_imports(node):
    if isinstance(node, ast.ImportFrom):
        names = [node.module or ""]
        if node.module == "math":
            yield from (f"math.{alias.name}" for alias in node.names if alias.name not in MATH)
        if node.module == "numpy":
            yield "from numpy import"
    else:
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
    yield from (name for name in names if name.split(".")[0] in STRANGERS)


def strange_names(node, inner):
    if isinstance(node, ast.Attribute) and id(node) not in inner:
        root, _, name = dotted(node).partition(".")
        if name not in {"math": MATH, "np": NUMPY}.get(root, {name}):
            yield f"{root}.{name}"


def strange_calls(node, has_floats):
    if not isinstance(node, ast.Call) or (text := ast.unparse(node)) in LISTED:
        return
    name, options = dotted(node.func), {k.arg: ast.unparse(k.value) for k in node.keywords}
    method = node.func.attr if isinstance(node.func, ast.Attribute) else ""
    if has_floats and name in ("sum", "pow"):
        yield text
    if method in SUMS and name.split(".")[0] not in ("np", "math", "sums"):
        yield text
    if method == "argsort" and options.get("kind") != "'stable'":
        yield f"{text} without kind='stable'"
    if name == "np.prod" and options.get("dtype") != "np.int64":
        yield f"{text} without dtype=np.int64"


def strange_operators(node):
    if not isinstance(node, ast.BinOp | ast.AugAssign):
        return
    operands = (node.left, node.right) if isinstance(node, ast.BinOp) else (node.target, node.value)
    is_power = isinstance(node.op, ast.Pow) and not all(map(is_literal, operands))
    if is_power or isinstance(node.op, ast.MatMult):
        yield ast.unparse(node)


def strange(text, has_floats=True):
    """What a module computes with operations that machines may round differently."""
    tree = ast.parse(text)
    inner = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    found = []
    for node in ast.walk(tree):
        found += [*strange_imports(node), *strange_names(node, inner)]
        found += [*strange_calls(node, has_floats), *strange_operators(node)]
    return found


@pytest.mark.parametrize("package", WALKED)
def test_states_are_made_of_operations_that_machines_agree_on(package):
    modules = sorted((PACKAGE / package).rglob("*.py"))
    assert modules
    found = {
        str(path.relative_to(PACKAGE)): strange(path.read_text(), package not in COUNTING)
        for path in modules
    }
    assert {path: names for path, names in found.items() if names} == {}


def test_every_exception_is_still_there():
    """An exception for a line that is gone could hide another one some day."""
    paths = [path for package in WALKED for path in (PACKAGE / package).rglob("*.py")]
    nodes = (node for path in paths for node in ast.walk(ast.parse(path.read_text())))
    assert {ast.unparse(node) for node in nodes if isinstance(node, ast.Call)} >= LISTED


STRANGE = """np.cos(x) | np.exp(x) | np.power(x, 3) | np.linalg.norm(x) | np.dot(a, b) | np.hypot(a, b)
    np.einsum('i,i', a, b) | np.interp(x, a, b) | np.quantile(x, 0.5) | np.add.reduce(x) | np.sum(x)
    np.random.default_rng(1) | np.random.Generator(raw) | np.argsort(x) | x.argsort() | x.sum()
    x[0].mean(axis=0) | (a * b).sum() | x.dot(y) | np.prod(x) | a @ b | a @= b | x ** 0.5 | x ** 2
    x **= 3 | 2.0 ** x | sum(x) | pow(x, 0.2) | math.sin(x) | math.exp(x) | math.hypot(x, y)
    math.pow(x, y) | from math import log | from math import sqrt, erf | import statistics
    from statistics import NormalDist | import scipy.special | from numpy import cos"""

ALIKE = """np.sqrt(x) | 2**31 - 1 | 10.0**-3 | np.argsort(x, kind='stable') | math.sqrt(x)
    from math import sqrt, pi | total(x) | x % y"""


@pytest.mark.parametrize(("lines", "count"), [(STRANGE, 1), (ALIKE, 0)])
def test_the_walk_finds_what_is_strange_and_nothing_else(lines, count):
    for line in lines.replace("\n", "|").split("|"):
        assert len(strange(line.strip())) == count, line

"""Records of arrays in kernels: Numba frees an array after its last use, and a record of it does
not count as one."""

import ast

import pytest
from places import ROOT


def _is_kernel(function):
    return any(
        isinstance(item, ast.Name) and "kernel" in item.id for item in function.decorator_list
    )


def _taken_out_of(value):
    """Array that an element is taken out of, by number; None for anything else."""
    is_element = isinstance(value, ast.Subscript) and isinstance(value.slice, ast.Constant)
    return value.value.id if is_element and isinstance(value.value, ast.Name) else None


def dangling_records(source):
    """Records of arrays that a kernel makes itself and does not use any more when it uses the
    record, as ``kernel: record``."""
    return [
        f"{function.name}: {record}"
        for function in ast.walk(ast.parse(source))
        if isinstance(function, ast.FunctionDef) and _is_kernel(function)
        for record in _dangling(function)
    ]


def _dangling(function):
    last_use, made, records, with_fields = {}, set(), {}, set()
    for node in ast.walk(function):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            last_use[node.id] = max(last_use.get(node.id, 0), node.lineno)
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name, array = node.targets[0].id, _taken_out_of(node.value)
            if array is not None:
                records[name] = array
            elif isinstance(node.value, ast.Call):
                made.add(name)
        if (
            isinstance(node, ast.Subscript)
            and isinstance(node.slice, ast.Constant)
            and isinstance(node.slice.value, str)
        ):
            with_fields.add(_taken_out_of(node))
    return [
        name
        for name, array in records.items()
        if name in with_fields and array in made and last_use[array] < last_use[name]
    ]


KERNELS = [
    path
    for path in sorted((ROOT / "multicor_cli").rglob("*.py"))
    if "kernel" in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("path", KERNELS, ids=lambda path: path.stem)
def test_no_record_outlives_its_array(path):
    assert not dangling_records(path.read_text(encoding="utf-8"))


def test_a_record_that_outlives_its_array_is_found():
    kernel = (
        "@kernel\ndef f(n):\n    memory = start(n)\n    loop = memory[0]\n    loop['a'] = 1.0\n"
        "    return {}\n"
    )
    assert dangling_records(kernel.format("loop['a']")) == ["f: loop"]
    assert dangling_records(kernel.format("memory")) == []
    assert (
        dangling_records(
            kernel.format("n")
            .replace("def f(n)", "def f(n, memory)")
            .replace("    memory = start(n)\n", "")
        )
        == []
    )

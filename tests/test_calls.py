"""A reader of a call sees what each value is: no more than four arguments go by position.

Kernels are left out: their arguments are the symbols of the equation in their docstring, and the arrays that are handed
over carry the same names, so keywords would say ``T=T``.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from import_graph import modules

MAX_POSITIONAL = 4
Function = ast.FunctionDef | ast.AsyncFunctionDef


def definitions(tree: ast.Module) -> set[str]:
    """Names of the functions, methods and classes of a file whose arguments are counted."""
    variadic = {n.name for n in ast.walk(tree) if isinstance(n, Function) and n.args.vararg}
    return {n.name for n in ast.walk(tree) if isinstance(n, (Function, ast.ClassDef))} - variadic


def from_kernels(tree: ast.Module) -> set[str]:
    """Names that a file imports from the kernels."""
    return {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("lsu_mesh.kernels")
        for alias in node.names
    }


def bare_names(tree: ast.Module) -> set[str]:
    """Names that a file defines, or imports from the project."""
    imported = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("lsu_mesh")
        for alias in node.names
    }
    return imported | definitions(tree)


def called(call: ast.Call) -> tuple[str, str]:
    """The name that is called, and the name before its first dot."""
    whole = ast.unparse(call.func)
    return whole.rpartition(".")[2], whole.partition(".")[0]


def long_calls(tree: ast.Module, project: set[str]) -> Iterator[ast.Call]:
    """Calls of the project's functions with too many arguments by position."""
    kernels, bare = from_kernels(tree), bare_names(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and sum(not isinstance(a, ast.Starred) for a in node.args) > MAX_POSITIONAL:
            name, first = called(node)
            is_ours = name in ("cls", "__init__") or (name in project and (name != first or name in bare))
            if is_ours and first not in kernels:
                yield node


def test_no_more_than_four_arguments_go_by_position(root: Path) -> None:
    trees = {
        path: ast.parse(path.read_text(encoding="utf-8"))
        for name, path in modules(root).items()
        if not name.startswith("lsu_mesh.kernels")
    }
    project = set().union(*map(definitions, trees.values()))
    found = [
        f"{path.relative_to(root)}:{call.lineno}: {ast.unparse(call.func)}"
        for path, tree in trees.items()
        for call in long_calls(tree, project)
    ]
    assert found == []


def test_a_long_call_is_found() -> None:
    lines = (
        "from lsu_mesh import f",
        "from lsu_mesh.kernels import step",
        "f(1, 2, 3, 4, 5)",
        "f(1, 2, 3, 4, e=5)",
        "step.go(1, 2, 3, 4, 5)",
        "print(1, 2, 3, 4, 5)",
    )
    tree = ast.parse("\n".join(lines))
    assert [call.lineno for call in long_calls(tree, {"f", "go"})] == [3]

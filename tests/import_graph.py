"""Which module of the project imports which, read from the source."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from pathlib import Path


def modules(root: Path) -> dict[str, Path]:
    """Every module of the two packages, by its full name."""
    found = {}
    for home, package in ((root, "lsu_mesh"), (root / "services", "lsu_mesh_services")):
        for path in sorted((home / package).rglob("*.py")):
            parts = path.relative_to(home).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def _statements(path: Path, *, runtime: bool) -> Iterator[ast.Import | ast.ImportFrom]:
    """Import statements, inside functions too; with ``runtime`` without those for type checkers only."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    skipped = {
        child
        for node in ast.walk(tree)
        if runtime and isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for statement in node.body
        for child in ast.walk(statement)
    }
    for node in ast.walk(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom)) and node not in skipped:
            yield node


def imports(path: Path) -> set[str]:
    """Full names of the modules that a file names in its imports, those for type checkers included."""
    found = set()
    for node in _statements(path, runtime=False):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif node.module:
            found.add(node.module)
    return found


def import_graph(files: Mapping[str, Path]) -> dict[str, set[str]]:
    """For each module those that it imports when it runs.

    ``from package import module`` is an import of the module, not of the package's own file.
    """
    graph: dict[str, set[str]] = {}
    for name, path in files.items():
        graph[name] = set()
        for node in _statements(path, runtime=True):
            if isinstance(node, ast.Import):
                graph[name] |= {alias.name for alias in node.names}
            else:
                whole = [f"{node.module}.{alias.name}" for alias in node.names]
                graph[name] |= {module if module in files else str(node.module) for module in whole}
        graph[name] &= files.keys() - {name}
    return graph


def circles(graph: Mapping[str, set[str]]) -> list[set[str]]:
    """Modules that reach each other: the strongly connected components of more than one module (Tarjan 1972)."""
    order: dict[str, int] = {}
    lowest: dict[str, int] = {}
    waiting: list[str] = []
    found = []

    def visit(module: str) -> None:
        order[module] = lowest[module] = len(order)
        waiting.append(module)
        for other in graph[module]:
            if other not in order:
                visit(other)
                lowest[module] = min(lowest[module], lowest[other])
            elif other in waiting:
                lowest[module] = min(lowest[module], order[other])
        if lowest[module] == order[module]:
            component = set(_popped(waiting, module))
            if len(component) > 1:
                found.append(component)

    for module in graph:
        if module not in order:
            visit(module)
    return found


def _popped(waiting: list[str], last: str) -> Iterator[str]:
    while True:
        module = waiting.pop()
        yield module
        if module == last:
            return

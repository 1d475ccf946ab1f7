"""Processes that cannot find some modules, as if their packages were not installed."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

PROGRAM = """
from importlib.machinery import PathFinder

find = PathFinder.find_spec


def find_spec(name, path=None, target=None):
    return None if name in {names!r} else find(name, path, target)


PathFinder.find_spec = find_spec
"""


def without(modules: Iterable[str], folder: Path) -> Path:
    """A folder for ``PYTHONPATH``: Python runs its ``sitecustomize`` before anything else."""
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(PROGRAM.format(names=tuple(modules)))
    return folder

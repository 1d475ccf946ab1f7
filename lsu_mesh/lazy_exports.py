"""Names that a package exports and loads when they are first used, so that importing the package costs nothing."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping, Sequence


def lazy_exports(
    package: str, homes: Mapping[str, Sequence[str]]
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """``__getattr__`` and ``__dir__`` of a package (PEP 562) that exports ``names`` of each module ``homes[module]``.

    A home that is a submodule of the package itself may have no names: then the submodule is what is exported. No name
    may be that of a submodule that holds it: once imported, the submodule would hide it.
    """
    home_of = {name: module for module, names in homes.items() for name in names}
    submodules = {module.rpartition(".")[2]: module for module, names in homes.items() if not names}

    def get_attribute(name: str) -> object:
        if name in home_of:
            return getattr(importlib.import_module(home_of[name]), name)
        if name in submodules:
            return importlib.import_module(submodules[name])
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    def list_names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *home_of, *submodules})

    return get_attribute, list_names

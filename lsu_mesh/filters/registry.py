"""The kinds of filters by name, loaded when first used: those of this library, and those of others.

A filter of somebody else needs no change here. Either its package states an entry point, ::

    [project.entry-points."lsu_mesh.filters"]
    MyFilter = "my_package.filters:MyFilter"

and its kind is ``"MyFilter"``; or its kind is ``"my_package.filters:MyFilter"``, module and class. A name of this
library's own kinds always means this library's class.
"""

from __future__ import annotations

import difflib
import functools
import importlib
import inspect
from typing import TYPE_CHECKING

from lsu_mesh.errors import ModelError
from lsu_mesh.filters.filter import Filter

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

FILTERS: dict[str, str] = {
    "Kalman": "lsu_mesh.filters.kalman",
    "LSUCZ": "lsu_mesh.filters.lsucz",
    "LSUO": "lsu_mesh.filters.lsuo",
    "LSUP": "lsu_mesh.filters.lsup",
    "LSUPB": "lsu_mesh.filters.lsupb",
    "TruncatedKalman": "lsu_mesh.filters.truncated_kalman",
    "WindowMAP": "lsu_mesh.filters.window.window_map",
    "ZonotopicKalman": "lsu_mesh.filters.zonotopic_kalman",
}
"""Kind of a filter of this library (the name of its class) → module that holds it."""
ENTRY_POINTS = "lsu_mesh.filters"
"""Group of the entry points by which installed packages add kinds."""


def filter_kinds() -> tuple[str, ...]:
    """All kinds that have a name, sorted: this library's and those of installed packages."""
    return tuple(sorted({*FILTERS, *_installed()}))


def filter_class(kind: str) -> type[Filter]:
    """The class of this kind: a name of :func:`filter_kinds`, or ``"module:Class"``.

    Raises ``ModelError`` that names the nearest valid kind, or the module, the class and what is wrong with it.
    """
    if kind in FILTERS:
        return _loaded(kind, FILTERS[kind], kind)
    if ":" in kind:
        module, _, name = kind.partition(":")
        return _loaded(kind, module, name)
    found = _installed().get(kind, ())
    if not found:
        valid = ", ".join((*filter_kinds(), "module:Class"))
        raise ModelError(f"there is no filter {kind!r}{_hint(kind)} (valid: {valid})")
    values = sorted({point.value for point in found})
    if len(values) > 1:
        raise ModelError(
            f"several installed packages have a filter {kind!r}: {', '.join(values)}; "
            f'write the one that is meant, as in kind = "{values[0]}"'
        )
    return _loaded(kind, found[0].module, found[0].attr)


@functools.cache
def _installed() -> dict[str, tuple[EntryPoint, ...]]:
    """Entry points of installed packages by name."""
    from importlib.metadata import entry_points

    points: dict[str, tuple[EntryPoint, ...]] = {}
    for point in entry_points(group=ENTRY_POINTS):
        points[point.name] = (*points.get(point.name, ()), point)
    return points


def _loaded(kind: str, module: str, name: str) -> type[Filter]:
    """The class ``name`` of a module; each way in which it may be no filter has its own message."""
    what = f"the filter {kind!r}"
    if not module or not name:
        raise ModelError(f'{what} must be written as "module:Class", such as "my_package.filters:MyFilter"')
    found: object = _imported(what, module)
    for part in name.split("."):
        if not hasattr(found, part):
            near = difflib.get_close_matches(part, dir(found), n=1, cutoff=0.5)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ModelError(f"{what}: the module {module!r} has no {name!r}{hint}")
        found = getattr(found, part)
    if not (inspect.isclass(found) and issubclass(found, Filter)):
        raise ModelError(f"{what}: {name!r} of {module!r} is no subclass of lsu_mesh.Filter, it is {found!r}")
    if inspect.isabstract(found):
        missing = ", ".join(sorted(found.__abstractmethods__))
        raise ModelError(f"{what}: the class {name!r} of {module!r} is abstract, it lacks {missing}")
    return found


def _imported(what: str, module: str) -> object:
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or not (module == error.name or module.startswith(f"{error.name}.")):
            raise ModelError(f"{what}: the module {module!r} needs {error.name!r}, which is not installed") from error
        raise ModelError(
            f"{what}: there is no module {error.name!r}; install the package that holds it, or put its folder on "
            "PYTHONPATH (the working folder is not searched)"
        ) from error
    except Exception as error:  # a module of somebody else may fail in any way, and the cause is told
        text = f"{what}: the module {module!r} cannot be imported: {type(error).__name__}: {error}"
        raise ModelError(text) from error


def _hint(kind: str) -> str:
    folded = {name.lower().replace("-", ""): name for name in filter_kinds()}
    near = difflib.get_close_matches(kind.lower().replace("-", ""), folded, n=1, cutoff=0.5)
    return f"; did you mean {folded[near[0]]!r}?" if near else ""

"""How kernels are compiled: numba, cached, no fast-math, no BLAS.

numba is imported when the first kernel runs: importing a kernel costs nothing, and a process that calls none, such as a
sensor, never loads it.

Same bits everywhere: explicit loops in a fixed order, no contraction to fused multiply-add (LLVM contracts only when
fast-math allows it), no library calls but ``sqrt``, ``abs``, ``log`` and ``exp``, the latter two for volumes only.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import re
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., object])

_FOLDER = Path(__file__).parents[1]
_IMPORT = re.compile(r"^from lsu_mesh\.kernels(?:\.([\w.]+))? import (\([^)]*\)|.*)", re.MULTILINE)

# Each flag is said for each kernel: what is left out, numba takes from the kernel that happens to call first.
_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": False,
    "forceinline": False,
    "no_cpython_wrapper": False,
    "no_cfunc_wrapper": False,
}
_NO_WRAPPERS: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_LOADING = threading.Lock()


def kernel(function: F) -> F:
    """Compile ``function`` on its first call and keep the machine code in numba's cache; Python may call it.

    The cache lies in ``NUMBA_CACHE_DIR``, else beside the source, else in the user's cache folder. Where none of
    these can be written the kernel is compiled anew in each process, which costs seconds and nothing else.
    """
    return cast(F, Kernel(function, {}, optimisation=3))


def inner(function: F) -> F:
    """As :func:`kernel`, for a function that only other kernels call: it compiles in half the time."""
    return cast(F, Kernel(function, _NO_WRAPPERS, optimisation=1))


def inlined(function: F) -> F:
    """As :func:`kernel`, copied into each caller: for tiny functions that call nothing but such ones.

    Python calls the function itself, without numba; the bits are the same.
    """
    return cast(F, Inlined(function, {"forceinline": True}, optimisation=1))


class Kernel:
    """A function that is compiled, or loaded from the cache, when it is first called.

    numba takes it for its :attr:`dispatcher`, other attributes are those of the dispatcher.
    """

    def __init__(self, function: Callable[..., object], options: dict[str, Any], optimisation: int) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self._options, self._optimisation = options, optimisation
        self._dispatcher: Any = None

    def __call__(self, *arguments: object) -> object:
        return (self._dispatcher or self.dispatcher)(*arguments)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.dispatcher, name)

    @property
    def dispatcher(self) -> Any:
        """What numba compiles the function with; imports numba when it is first asked for."""
        with _LOADING:
            if self._dispatcher is None:
                self._dispatcher = _compiled(self.py_func, self._options, self._optimisation)
        return self._dispatcher

    @property
    def _numba_type_(self) -> Any:
        """The type of the function where another kernel calls it."""
        return self.dispatcher._numba_type_


class Inlined(Kernel):
    """See :func:`inlined`."""

    def __call__(self, *arguments: object) -> object:
        return self.py_func(*arguments)


def _compiled(function: Callable[..., object], options: dict[str, Any], optimisation: int) -> Any:
    import numba

    compiled: Any
    try:
        compiled = numba.njit(cache=True, **{**_OPTIONS, **options})(function)
    except RuntimeError:  # numba: "cannot cache function: no locator available"
        compiled = numba.njit(**{**_OPTIONS, **options})(function)
    else:
        # numba looks at the kernel's own file only: machine code would outlive a change of a kernel that it calls
        source = Path(function.__code__.co_filename)
        if source.is_relative_to(_FOLDER) and source.exists():
            module = ".".join(source.relative_to(_FOLDER).with_suffix("").parts)
            compiled._cache._cache_file._source_stamp = _stamp(module)
    compiled.compile = _with_settings(compiled.compile, optimisation)
    return compiled


def awaits_compilation(compiled: Callable[..., object]) -> bool:
    """Whether a kernel can be cached and its machine code, as its source is now, is not in the cache yet."""
    file = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
    return file is not None and not file._load_index()


def _with_settings(compile_signature: Callable[[Any], Any], optimisation: int) -> Callable[[Any], Any]:
    """Compile for loops over a handful of entries: vectorised, they take twice as long to compile *and* to run."""
    from numba.core import config as numba_config

    config: Any = numba_config

    def compile_small_loops(signature: Any) -> Any:
        _load_registries_without_scipy()
        before = config.OPT, config.LOOP_VECTORIZE
        config.OPT, config.LOOP_VECTORIZE = type(config.OPT)(optimisation), 0
        try:
            return compile_signature(signature)
        finally:
            config.OPT, config.LOOP_VECTORIZE = before

    return compile_small_loops


@functools.cache
def _load_registries_without_scipy() -> None:
    """numba loads SciPy's linear algebra with its registries, only to know that a BLAS is there; no kernel calls it.

    SciPy is installed with this package, so the answer is known, and a new process is a quarter faster. Whoever
    compiles a product of matrices later has numba load SciPy then.
    """
    if "numba.np.arraymath" not in sys.modules:
        linalg: Any = importlib.import_module("numba.np.linalg")
        ask = linalg.ensure_blas
        linalg.ensure_blas = lambda: None
        try:
            importlib.import_module("numba.np.arraymath").ensure_blas = ask  # type: ignore[attr-defined]
        finally:
            linalg.ensure_blas = ask


@functools.cache
def _stamp(module: str) -> str:
    """Digest of a kernel's file and of the kernel files that it imports, however indirectly."""
    digest = hashlib.sha256()
    for name in sorted(_closure(module)):
        digest.update(_file(name).read_bytes())
    return digest.hexdigest()


def _file(module: str) -> Path:
    """The file of a module of kernels, named from ``lsu_mesh.kernels`` on: ``"parallelotopes.box"``."""
    return _FOLDER.joinpath(*module.split(".")).with_suffix(".py")


def _closure(module: str) -> set[str]:
    reached: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in reached or not _file(name).exists():
            continue
        reached.add(name)
        for home, names in _IMPORT.findall(_file(name).read_text(encoding="utf-8")):
            if home and _file(home).exists():
                waiting.append(home)
            else:
                waiting.extend(f"{home}.{part}" if home else part for part in re.findall(r"\w+", names))
    return reached

"""What decides whether machine code in the cache may be used again."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from lsu_mesh.kernels.runtime import compile as compiling
from lsu_mesh.kernels.runtime.rounding import down, gamma, up


def test_the_code_of_a_kernel_depends_on_every_kernel_that_it_calls() -> None:
    called = {
        "filter_step",
        "parallelotopes.bundle",
        "parallelotopes.box",
        "parallelotopes.strip_update",
        "runtime.rounding",
    }
    assert called | {"batch_run", "runtime.compile"} <= compiling._closure("batch_run")
    assert compiling._closure("runtime.rounding") == {"runtime.rounding", "runtime.compile"}


def test_a_changed_callee_changes_the_stamp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "caller.py").write_text("from lsu_mesh.kernels.callee import f\n")
    (tmp_path / "callee.py").write_text("f = 1\n")
    monkeypatch.setattr(compiling, "_FOLDER", tmp_path)
    before = compiling._stamp.__wrapped__("caller")
    (tmp_path / "callee.py").write_text("f = 2\n")
    assert compiling._stamp.__wrapped__("caller") != before


NO_CACHE = """
from numba.core import caching
caching.CacheImpl._locator_classes = []  # as where neither the source's folder nor the user's can be written
"""


def test_kernels_work_where_no_cache_can_be_written() -> None:
    run(f"{NO_CACHE}\nfrom lsu_mesh.kernels.points.normal import scaled_tail\nassert round(scaled_tail(0.0), 9) == 1.0")


@pytest.mark.parametrize(("preparation", "before"), [("", True), (NO_CACHE, False)])
def test_a_kernel_awaits_compilation_until_it_is_in_the_cache(tmp_path: Path, preparation: str, before: bool) -> None:
    """One that cannot be cached awaits nothing: compiling it in another process would be in vain."""
    program = f"""{preparation}
from lsu_mesh.kernels.points.normal import scaled_tail
from lsu_mesh.kernels.runtime.compile import awaits_compilation as awaits
assert awaits(scaled_tail) is {before}
scaled_tail(1.0)
assert not awaits(scaled_tail)
"""
    run(program, NUMBA_CACHE_DIR=str(tmp_path))


def test_a_first_kernel_does_not_load_linear_algebra_of_scipy_and_numba_still_finds_it() -> None:
    run("""
import sys
from lsu_mesh.kernels.points.normal import scaled_tail
assert round(scaled_tail(0.0), 9) == 1.0
assert "scipy.linalg" not in sys.modules
import numba, numpy
assert numba.njit(lambda a: numpy.dot(a, a))(numpy.full(3, 2.0)) == 12.0
assert "scipy.linalg" in sys.modules
""")


def test_numba_is_loaded_with_the_first_kernel_that_runs_and_not_before() -> None:
    run("""
import sys
from lsu_mesh.kernels import batch_run, filter_step
from lsu_mesh.kernels.points.normal import scaled_tail
from lsu_mesh.kernels.runtime.rounding import up
assert up(1.0) > 1.0, "Python calls an inlined one itself"
assert scaled_tail.__name__ == "scaled_tail" and scaled_tail.__doc__
assert "numba" not in sys.modules
assert round(scaled_tail(0.0), 9) == 1.0
assert "numba" in sys.modules
assert len(scaled_tail.signatures) == 1, "it has what numba's dispatchers have"
""")


def test_threads_that_call_a_kernel_at_once_share_its_machine_code() -> None:
    loaded, start = [], threading.Barrier(4)
    kernel = compiling.kernel(lambda x: x + 1.0)

    def load() -> None:
        start.wait()
        loaded.append(kernel.dispatcher)  # type: ignore[attr-defined]

    threads = [threading.Thread(target=load) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(loaded) == 4
    assert all(one is loaded[0] for one in loaded)


def test_an_inlined_kernel_has_the_same_bits_in_python_and_compiled() -> None:
    from_numba = compiling.kernel(lambda x: down(up(x)) * gamma(7))
    for x in np.random.default_rng(1).normal(size=100) * 10.0 ** np.arange(-50, 50):
        assert from_numba(x) == down(up(x)) * gamma(7)


def run(program: str, **environment: str) -> None:
    command = [sys.executable, "-c", program]
    subprocess.run(command, env={**os.environ, **environment}, check=True, cwd=Path(__file__).parents[3])

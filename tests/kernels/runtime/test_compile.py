"""What decides whether machine code in the cache may be used again."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from lsu_mesh.kernels.runtime import compile as compiling


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


def test_kernels_work_where_no_cache_can_be_written(tmp_path: Path) -> None:
    program = "from lsu_mesh.kernels.runtime.rounding import up; assert up(1.0) > 1.0"
    environment = {"NUMBA_CACHE_DIR": "/proc/nowhere", "HOME": "/proc/nowhere", "PATH": "/usr/bin"}
    subprocess.run([sys.executable, "-c", program], env=environment, check=True, cwd=tmp_path)


@pytest.mark.parametrize(("folder", "before"), [("cache", True), ("/proc/nowhere", False)])
def test_a_kernel_awaits_compilation_until_it_is_in_the_cache(tmp_path: Path, folder: str, before: bool) -> None:
    """One that cannot be cached awaits nothing: compiling it in another process would be in vain."""
    program = (
        "from lsu_mesh.kernels.runtime.rounding import up; "
        "from lsu_mesh.kernels.runtime.compile import awaits_compilation as awaits; "
        f"assert awaits(up) is {before}; up(1.0); assert not awaits(up)"
    )
    environment = {"NUMBA_CACHE_DIR": str(tmp_path / folder), "HOME": "/proc/nowhere", "PATH": "/usr/bin"}
    subprocess.run([sys.executable, "-c", program], env=environment, check=True, cwd=Path(__file__).parents[3])


def test_a_first_kernel_does_not_load_linear_algebra_of_scipy_and_numba_still_finds_it() -> None:
    program = """
import sys
from lsu_mesh.kernels.runtime.rounding import up
assert up(1.0) > 1.0
assert "scipy.linalg" not in sys.modules
import numba, numpy
assert numba.njit(lambda a: numpy.dot(a, a))(numpy.full(3, 2.0)) == 12.0
assert "scipy.linalg" in sys.modules
"""
    subprocess.run([sys.executable, "-c", program], check=True, cwd=Path(__file__).parents[3])

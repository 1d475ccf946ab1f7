"""Packages export their public names, and load them when they are first used."""

from __future__ import annotations

import importlib
import subprocess
import sys
from types import ModuleType

import pytest

from lsu_mesh.lazy_exports import lazy_exports

EXPORTING = ("lsu_mesh", "lsu_mesh.filters", "lsu_mesh.fusion", "lsu_mesh.supports")
HEAVY = ("zenoh", "rerun", "msgspec", "msgpack", "numba", "scipy")


@pytest.mark.parametrize("package", EXPORTING)
def test_every_public_name_can_be_imported_and_is_listed(package: str) -> None:
    module = importlib.import_module(package)
    assert module.__all__
    for name in module.__all__:
        value = getattr(module, name)
        assert getattr(value, "__name__", "").rpartition(".")[2] == name, (package, name, value)
    assert set(module.__all__) <= set(dir(module))


def test_a_name_is_the_same_thing_in_its_package_and_in_lsu_mesh() -> None:
    top = importlib.import_module("lsu_mesh")
    for package in EXPORTING[1:]:
        module = importlib.import_module(package)
        for name in set(module.__all__) & set(top.__all__):
            assert getattr(module, name) is getattr(top, name)


def test_all_filters_can_be_imported_from_their_package() -> None:
    from lsu_mesh.filters import registry

    assert set(registry.FILTERS) <= set(importlib.import_module("lsu_mesh.filters").__all__)


def test_fuse_stays_the_function_after_its_module_was_imported() -> None:
    importlib.import_module("lsu_mesh.fusion.fuse")
    from lsu_mesh.fusion import fuse

    assert not isinstance(fuse, ModuleType)


@pytest.mark.parametrize("package", EXPORTING)
def test_a_name_that_is_not_there_is_an_attribute_error(package: str) -> None:
    module = importlib.import_module(package)
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'LSUX'"):
        _ = module.LSUX
    with pytest.raises(ImportError, match="LSUX"):
        exec(f"from {package} import LSUX")


def test_importing_the_packages_loads_nothing_heavy() -> None:
    lazy = [name for name in EXPORTING if name != "lsu_mesh.fusion"]
    check = f"import sys, {', '.join(lazy)}\nprint([name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-P", "-c", check], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_mechanism_exports_names_and_submodules() -> None:
    get_attribute, list_names = lazy_exports("lsu_mesh", {"fractions": ("Fraction",), "lsu_mesh.errors": ()})
    assert get_attribute("Fraction") is importlib.import_module("fractions").Fraction
    assert get_attribute("errors") is importlib.import_module("lsu_mesh.errors")
    assert {"Fraction", "errors", "__version__"} <= set(list_names())
    with pytest.raises(AttributeError, match="module 'lsu_mesh' has no attribute 'fractions'"):
        get_attribute("fractions")

"""Filters of others: by an entry point of an installed package, or by module and class; mistakes are named."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from lsu_mesh import LSUO, ModelError
from lsu_mesh.filters import registry
from lsu_mesh.filters.registry import filter_class, filter_kinds

OWN = """
from lsu_mesh import LSUO, Filter
class Mine(LSUO):
    pass
class Named(LSUO):
    kind = "a name"
class Unfinished(Filter):
    pass
box = 3
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder on the path with modules of its own; none of them stays imported."""
    (tmp_path / "own_filters.py").write_text(OWN)
    (tmp_path / "own_broken.py").write_text("1 / 0")
    (tmp_path / "own_unmet.py").write_text("import nowhere_at_all")
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in [name for name in sys.modules if name.startswith("own_")]:
        del sys.modules[name]


@pytest.fixture
def installed(folder: Path) -> Iterator[Path]:
    """As if a package with entry points were installed in the folder."""
    metadata = folder / "own_package-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: own-package\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(
        "[lsu_mesh.filters]\nMine = own_filters:Mine\nLSUO = own_filters:Mine\nGone = own_filters:Gone\n"
    )
    registry._installed.cache_clear()
    yield folder
    registry._installed.cache_clear()


def test_a_class_is_found_by_module_and_name(folder: Path) -> None:
    found = filter_class("own_filters:Mine")
    assert issubclass(found, LSUO)
    assert (found.kind, found.guarantee) == ("Mine", "declared")
    assert filter_class("own_filters:Named").kind == "a name"


def test_a_class_of_an_installed_package_is_found_by_its_name(installed: Path) -> None:
    assert filter_class("Mine").__module__ == "own_filters"
    assert {"Mine", "LSUO", "WindowMAP"} <= set(filter_kinds())


def test_the_names_of_this_library_are_its_own(installed: Path) -> None:
    assert filter_class("LSUO") is LSUO


def test_two_packages_with_one_name_are_told(installed: Path) -> None:
    other = installed / "other_package-1.0.dist-info"
    other.mkdir()
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: other-package\nVersion: 1.0\n")
    (other / "entry_points.txt").write_text("[lsu_mesh.filters]\nMine = own_filters:Named\n")
    registry._installed.cache_clear()
    with pytest.raises(ModelError, match="have a filter 'Mine': own_filters:Mine, own_filters:Named"):
        filter_class("Mine")


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("own_filters:Mina", "the module 'own_filters' has no 'Mina'; did you mean 'Mine'"),
        ("own_filters:box", "'box' of 'own_filters' is no subclass of lsu_mesh.Filter, it is 3"),
        ("own_filters:Unfinished", "the class 'Unfinished' of 'own_filters' is abstract, it lacks condition"),
        ("own_filter:Mine", "there is no module 'own_filter'; install the package .* PYTHONPATH"),
        ("own_filters.deeper:Mine", "no module 'own_filters.deeper'"),
        ("own_broken:Mine", "'own_broken' cannot be imported: ZeroDivisionError: division by zero"),
        ("own_unmet:Mine", "'own_unmet' needs 'nowhere_at_all', which is not installed"),
        (":Mine", 'must be written as "module:Class"'),
        ("own_filters:", 'must be written as "module:Class"'),
        ("Gone", "the module 'own_filters' has no 'Gone'"),
        ("Mein", "there is no filter 'Mein'; did you mean 'Mine'"),
    ],
)
def test_what_is_no_filter_is_named(installed: Path, kind: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        filter_class(kind)

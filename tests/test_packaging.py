"""The wheel and the source distribution, built from a copy of what is committed with strays beside it."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest
from lsu_mesh_services.extras import EXTRAS
from lsu_mesh_services.gateway.application import PAGE

BUILD = "import sys; from hatchling import build as b; print(b.build_{kind}(sys.argv[1]))"
STRAYS = (
    "examples/adsb/data/flight.csv", "runs/demo.rrd", "demo.rrd", "build/lib/lsu_mesh/old.py", "dist/old.whl",
    ".venv/lib/lsu_mesh/x.py", "worktree/lsu_mesh/x.py", "worktree/tests/x.py", "lsu_mesh/__pycache__/x.pyc",
    "notes.md", "keys/ca.key",
)  # fmt: skip
"""Files that a folder in use holds, and that nobody must get."""
LEFT_OUT = ".ci/"
"""Committed, and of use to the host of the repository only."""
Files = dict[str, bytes]


@pytest.fixture(scope="module")
def tracked(root: Path) -> set[str]:
    try:
        done = subprocess.run(["git", "ls-files", "-z"], cwd=root, capture_output=True, text=True, check=True)
    except (FileNotFoundError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    return {name for name in done.stdout.split("\0") if (root / name).is_file()}


@pytest.fixture(scope="module")
def checkout(root: Path, tracked: set[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what is committed, and strays."""
    folder = tmp_path_factory.mktemp("checkout")
    for name in tracked:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(root / name, folder / name)
    for name in STRAYS:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("stray")
    return folder


def build(kind: str, source: Path, target: Path) -> Path:
    """What hatchling builds of a folder, without a network."""
    command = [sys.executable, "-P", "-c", BUILD.format(kind=kind), str(target)]
    done = subprocess.run(command, cwd=source, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return target / done.stdout.split()[-1]


def in_wheel(path: Path) -> Files:
    with zipfile.ZipFile(path) as wheel:
        return {name: wheel.read(name) for name in wheel.namelist()}


@pytest.fixture(scope="module")
def wheel(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> Files:
    return in_wheel(build("wheel", checkout, tmp_path_factory.mktemp("wheel")))


@pytest.fixture(scope="module")
def unpacked(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source distribution, unpacked."""
    folder = tmp_path_factory.mktemp("sdist")
    archive = build("sdist", checkout, folder)
    with tarfile.open(archive) as tar:
        tar.extractall(folder, filter="data")
    return folder / archive.name.removesuffix(".tar.gz")


def test_a_wheel_installs_our_two_packages_with_their_data_and_nothing_else(wheel: Files, tracked: set[str]) -> None:
    metadata = {name for name in wheel if name.startswith("lsu_mesh-") and ".dist-info/" in name}
    packages = {
        name.removeprefix("services/")
        for name in tracked
        if name.startswith(("lsu_mesh/", "services/lsu_mesh_services/"))
    }
    assert set(wheel) - metadata == packages
    others = {name for name in packages if not name.endswith(".py")}
    page = {f"lsu_mesh_services/gateway/page/{name}" for name in PAGE}
    assert others == page | {"lsu_mesh/py.typed", "lsu_mesh_services/py.typed", "lsu_mesh_services/demo.toml"}
    assert b"lsu-mesh = lsu_mesh_services.cli:entry" in b"".join(wheel[name] for name in metadata)


def test_the_source_distribution_holds_what_is_committed_and_no_strays(unpacked: Path, tracked: set[str]) -> None:
    found = {str(path.relative_to(unpacked)) for path in unpacked.rglob("*") if path.is_file()}
    assert found - {"PKG-INFO"} == {name for name in tracked if not name.startswith(LEFT_OUT)}
    assert {name.partition("/")[0] for name in found} >= {"tests", "docs", "examples", "benchmarks", "docker"}


def test_the_source_distribution_builds_the_same_wheel(unpacked: Path, wheel: Files, tmp_path: Path) -> None:
    assert in_wheel(build("wheel", unpacked, tmp_path)) == wheel


def project(root: Path) -> dict[str, Any]:
    table: dict[str, Any] = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    return table


def names(requirements: list[str]) -> list[str]:
    """Names of distributions, without versions."""
    return [re.split(r"[<>=!~;]", requirement)[0].strip() for requirement in requirements]


def test_the_extras_are_those_that_commands_look_for(root: Path) -> None:
    declared = {extra: names(listed) for extra, listed in project(root)["optional-dependencies"].items()}
    for extra, inner in (("record", "mesh"), ("ros2", "mesh"), ("gateway", "mesh"), ("mcap", "record")):
        assert declared[extra][0] == f"lsu-mesh[{inner}]"
        declared[extra][:1] = declared[inner]
    assert {extra.name: list(extra.modules) for extra in EXTRAS} == {
        name: declared[name] for name in ("mesh", "record", "ros2", "gateway", "mcap")
    }
    base = names(project(root)["dependencies"])
    assert base == ["numpy", "scipy", "numba", "msgspec", "rich"]


def test_every_requirement_has_a_tested_version(root: Path) -> None:
    pinned = {line.split("==")[0] for line in (root / "constraints.txt").read_text().splitlines() if "==" in line}
    wanted = set(names(project(root)["dependencies"]))
    wanted |= {name for listed in project(root)["optional-dependencies"].values() for name in names(listed)}
    assert {name for name in wanted if not name.startswith("lsu-mesh[")} <= {name.replace("_", "-") for name in pinned}

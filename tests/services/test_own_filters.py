"""A filter of somebody else's package in a configuration, in a process of its own as ``lsu-mesh run`` starts them."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest


@pytest.fixture
def folder(demo: Path, tmp_path: Path) -> Path:
    """A working folder with a configuration that names a class of ``elsewhere/own_filters.py``."""
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "own_filters.py").write_text("from lsu_mesh import LSUO\nclass Mine(LSUO):\n    pass\n")
    text = demo.read_text().replace('kind = "LSUO"', 'kind = "own_filters:Mine"\nmeet = false')
    (tmp_path / "mesh.toml").write_text(text)
    return tmp_path


def run(command: list[str], folder: Path, *more_paths: Path) -> subprocess.CompletedProcess[str]:
    paths = os.pathsep.join([os.environ.get("PYTHONPATH", ""), *map(str, more_paths)])
    environment = {**os.environ, "PYTHONPATH": paths}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120)


def test_a_class_on_the_path_is_used(lsu_mesh_command: list[str], folder: Path) -> None:
    checked = run([*lsu_mesh_command, "validate", "mesh.toml"], folder, folder / "elsewhere")
    assert checked.returncode == 0, checked.stderr
    simulated = run(
        [*lsu_mesh_command, "simulate", "mesh.toml", "--steps", "20", "--seeds", "1"], folder, folder / "elsewhere"
    )
    assert simulated.returncode == 0, simulated.stdout + simulated.stderr


def test_a_class_in_the_working_folder_is_not_found_and_the_remedy_is_told(
    lsu_mesh_command: list[str], folder: Path
) -> None:
    (folder / "own_filters.py").write_text("raise SystemExit('imported from the working folder')")
    result = run([*lsu_mesh_command, "validate", "mesh.toml"], folder)
    assert result.returncode == 2
    assert (
        "mesh.toml: line 34: [filters.box] kind: the filter 'own_filters:Mine': there is no module 'own_filters'"
        in result.stderr
    )
    assert "PYTHONPATH" in result.stderr


def test_its_options_are_checked_as_those_of_any_filter(lsu_mesh_command: list[str], folder: Path) -> None:
    text = (folder / "mesh.toml").read_text().replace("meet = false", "meat = false")
    (folder / "mesh.toml").write_text(text)
    result = run([*lsu_mesh_command, "validate", "mesh.toml"], folder, folder / "elsewhere")
    assert result.returncode == 2
    assert 'meat: unknown key; did you mean "meet"?' in result.stderr

"""The flights of the ADS-B example, fetched."""

from __future__ import annotations

import importlib.util
import subprocess
from pathlib import Path
from types import ModuleType

import pytest

from lsu_mesh.mesh.config import Configuration, load


def convert_module(root: Path) -> ModuleType:
    """The example's converter."""
    spec = importlib.util.spec_from_file_location("convert", root / "examples" / "adsb" / "convert.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def flight(root: Path, folder: Path, convert: ModuleType, name: str, *overrides: str) -> Configuration:
    """The example's configuration with a flight that is fetched; a skip where that cannot be done."""
    try:
        start, _, _ = convert.convert(name, folder / f"{name}.csv")
    except subprocess.CalledProcessError:
        pytest.skip(f"{convert.PACKAGE}, which carries the flights, cannot be fetched here")
    played = [f'sensors.baro.file="{folder / f"{name}.csv"}"', f"mesh.start_time={start - 1.0}"]
    return load(root / "examples" / "adsb" / "adsb.toml", [*played, *overrides])

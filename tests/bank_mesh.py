"""A small mesh of banks for tests: targets in the plane, with velocities, and two sensors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lsu_mesh.mesh.bank_messages import BankMeasurement, BankPosterior, BankTruth
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.messages import Message

TEXT = """
[mesh]
name = "targets"
dt = 0.1
steps = 40

[model]
A = [[1.0, 0.1, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.1], [0.0, 0.0, 0.0, 1.0]]
rho = [0.01, 0.05, 0.01, 0.05]

[model.prior]
lower = [-5.0, -2.0, -5.0, -2.0]
upper = [5.0, 2.0, 5.0, 2.0]

[sensors.radar]
C = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]
r = [0.5, 0.5]

[sensors.lidar]
C = [[1.0, 0.0, 1.0, 0.0]]
r = [0.2]

[filters.targets]
kind = "LSUO"
sensors = ["radar", "lidar"]
instances = 12
"""
DOMAIN = "model.domain={lower=[-99.0,-9.0,-99.0,-9.0],upper=[99.0,9.0,99.0,9.0]}"


def write(folder: Path, text: str = TEXT) -> Path:
    """The configuration as a file."""
    file = folder / "mesh.toml"
    file.write_text(text)
    return file


def targets(folder: Path, *overrides: str) -> Configuration:
    """The mesh with some keys changed."""
    return load(write(folder), overrides)


def truths(messages: Sequence[tuple[str, Message]]) -> dict[int, BankTruth]:
    """True states by step."""
    return {one.step: one for _, one in messages if isinstance(one, BankTruth)}


def measurements(messages: Sequence[tuple[str, Message]]) -> dict[tuple[str, int], BankMeasurement]:
    """Measurements by sensor and step."""
    return {(one.name, one.step): one for _, one in messages if isinstance(one, BankMeasurement)}


def posteriors(messages: Sequence[tuple[str, Message]], name: str = "targets") -> dict[int, BankPosterior]:
    """Posteriors of a bank by step."""
    return {one.step: one for _, one in messages if isinstance(one, BankPosterior) and one.name == name}

"""The mesh that is measured: a plant, three sensors, filters of three kinds in turn, and a fusion of all of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lsu_mesh.mesh.config import Configuration, load_values

NAME = "bench"
FUSION = "main"
SENSORS = ("s1", "s2", "s3")
KINDS: tuple[dict[str, Any], ...] = (
    {"kind": "LSUO", "sensors": ["s1", "s2"]},
    {"kind": "LSUP", "sensors": ["s1"]},
    {"kind": "LSUCZ", "sensors": ["s2", "s3"], "max_generators": 20, "max_constraints": 8},
)
"""The filters of the demo."""
DEMO_A = [[1.0, -0.5, 0.2], [0.5, 0.1, 0.0], [0.3, 0.0, -0.1]]
DEMO_B = [[0.1], [0.6], [0.3]]
DEMO_C = ([1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [1.0, -1.0, 0.3])
"""Pavelková & Jirsa 2018, eq. (15), with a third sensor, as in the demo."""
DEMO_STATES = 3


def mesh_values(
    rate: float, filters: int, *, states: int = DEMO_STATES, steps: int = 1_000_000, entry: str = ""
) -> dict[str, Any]:
    """TOML values of the mesh: ``rate`` steps a second, filters ``f1 …``, and the endpoint that newcomers find.

    With three states it is the system of the demo, else a stable random one (see :func:`stable_system`).
    """
    A, B, C = (DEMO_A, DEMO_B, DEMO_C) if states == DEMO_STATES else stable_system(states)
    names = [f"f{k + 1}" for k in range(filters)]
    values: dict[str, Any] = {
        "mesh": {"name": NAME, "dt": 1.0 / rate, "steps": steps, "seed": 1},
        "model": {"A": A, "B": B, "rho": [0.1] * states, "prior": {"lower": [-5.0] * states, "upper": [5.0] * states}},
        "plant": {"inputs": "normal"},
        "sensors": {name: {"C": [row], "r": [0.3]} for name, row in zip(SENSORS, C, strict=True)},
        "filters": {name: dict(KINDS[k % len(KINDS)]) for k, name in enumerate(names)},
        "fusion": {FUSION: {"sources": names}},
    }
    if states > DEMO_STATES:
        for table in values["filters"].values():
            if table["kind"] == "LSUCZ":
                table["max_generators"] = max(20, states + 8)
    return values if not entry else {**values, "network": {"entry": entry}}


def stable_system(n: int) -> tuple[list[list[float]], list[list[float]], list[list[float]]]:
    """``A (n, n)``, ``B (n, 1)``, three rows of outputs, from a fixed seed.

    A is orthogonal, scaled to absolute row sums ≤ 0.9: boxes stay bounded under it.
    """
    random = np.random.default_rng(n)
    A = np.linalg.qr(random.normal(size=(n, n)))[0]
    A *= 0.9 / np.abs(A).sum(axis=1).max()
    return A.tolist(), random.normal(size=(n, 1)).tolist(), random.normal(size=(len(SENSORS), n)).tolist()


def configuration(rate: float, filters: int, *, states: int = DEMO_STATES) -> Configuration:
    """The configuration of the mesh, for nodes without a network."""
    return load_values(mesh_values(rate, filters, states=states), Path("bench.toml"))

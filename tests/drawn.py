"""What a recording shows: the values of its entities."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from lsu_mesh_services.recording.synthetic_mesh import Arrival
from numpy.typing import NDArray
from rerun.chunk import RrdReader


def drawn(path: Path, entity: str, component: str) -> list[tuple[int, list[Any]]]:
    """``(step, values)`` of one component of one entity, in the order of steps."""
    rows: list[tuple[int, list[Any]]] = []
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="RRD file has no footer")
        chunks = RrdReader(path).stream().filter(content=entity)
    for chunk in chunks:
        batch = chunk.to_record_batch()
        if component in batch.schema.names and "step" in batch.schema.names:
            rows += zip(batch.column("step").to_pylist(), batch.column(component).to_pylist(), strict=True)
    return sorted(((step, values) for step, values in rows if values is not None), key=lambda row: row[0])


def values_of(path: Path, entity: str, component: str = "Measurements:values") -> NDArray[np.float64]:
    """Values as (rows, series)."""
    return np.array([values for _, values in drawn(path, entity, component)])


def messages(arrivals: Sequence[Arrival], kind: type, name: str = "") -> list[Any]:
    return [a.message for a in arrivals if type(a.message) is kind and name in ("", a.message.name)]

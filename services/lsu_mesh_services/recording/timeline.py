"""The three timelines: ``step``, ``sim_time`` and ``wall_time`` (arrival at the recorder).

``sim_time`` counts from t_0: step · dt, or the moment of a measurement that has one of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import rerun as rr

STEP, SIM_TIME, WALL_TIME = "step", "sim_time", "wall_time"
LAST_NS = 2**63 - 1


class Stream(Protocol):
    """Where drawings are written."""

    def log(self, entity: str, archetype: rr.AsComponents, *, static: bool) -> None:
        """Write a style."""

    def send_columns(self, entity: str, times: list[rr.TimeColumn], columns: Iterable[rr.ComponentColumn]) -> None:
        """Write rows."""


class Moment(NamedTuple):
    """When something is drawn: the step that it is about and the arrival in nanoseconds since 1970."""

    step: int
    wall_ns: int
    since_start_ns: int | None = None
    """Its moment, counted from t_0; ``None``: that of its step."""


@dataclass(frozen=True)
class Timelines:
    """Time columns of rows; dt in seconds."""

    dt: float

    def columns(self, moments: Sequence[Moment]) -> list[rr.TimeColumn]:
        """One column per timeline."""
        steps = np.array([moment.step for moment in moments], dtype=np.int64)
        seconds = np.minimum(steps * self.dt, 9e9)  # 285 years; a step far beyond the run must not overflow
        simulated = np.rint(seconds * 1e9).astype(np.int64)
        own = [(i, since) for i, (_, _, since) in enumerate(moments) if since is not None]
        for i, since in own:
            simulated[i] = min(max(since, -LAST_NS), LAST_NS)
        return [
            rr.TimeColumn(STEP, sequence=steps),
            rr.TimeColumn(SIM_TIME, duration=simulated.astype("timedelta64[ns]")),
            wall_column([moment.wall_ns for moment in moments]),
        ]


def step_columns(moments: Sequence[Moment]) -> list[rr.TimeColumn]:
    """The columns of steps and arrivals, without simulated time: for rows that are read and not looked at."""
    steps = np.array([moment.step for moment in moments], dtype=np.int64)
    return [rr.TimeColumn(STEP, sequence=steps), wall_column([moment.wall_ns for moment in moments])]


def wall_column(wall_ns: Sequence[int]) -> rr.TimeColumn:
    """The column of arrivals alone, for what belongs to no step."""
    return rr.TimeColumn(WALL_TIME, timestamp=np.array(wall_ns, dtype=np.int64).astype("datetime64[ns]"))


def one_row(archetype: rr.AsComponents) -> list[rr.ComponentColumn]:
    """An archetype as columns of a single row."""
    batches = archetype.as_component_batches()
    return [
        rr.ComponentColumn(batch.component_descriptor(), batch, lengths=[len(batch.as_arrow_array())])
        for batch in batches
    ]

"""The inputs of a plant that plays a file, by step."""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Flags, Integers, Vector
from lsu_mesh.mesh.config.settings import Configuration, MeasurementFileSettings
from lsu_mesh.mesh.data_files import DataFile, DataFileError, read
from lsu_mesh.mesh.data_files.spans import duration_text


def recorded_inputs(configuration: Configuration, settings: MeasurementFileSettings) -> dict[int, Vector]:
    """u (p,) of each step that has a row without a missing value.

    An input acts from t_k on, so that a row belongs to the step that it begins: it has to lie on the grid, or at most
    ``input_delay`` after it. Rows before step 1 are left out.

    Raises :class:`lsu_mesh.mesh.data_files.DataFileError` for a file that cannot be read, a row that belongs to no
    step, and two rows of one step.
    """
    data = read(settings, configuration.base_model.input_count)
    steps = _begun_steps(data, configuration)
    inside = steps >= 1
    twice = np.flatnonzero(inside[1:] & (steps[1:] == steps[:-1]))
    if len(twice):
        line = int(data.lines[twice[0] + 1])
        step = int(steps[twice[0] + 1])
        text = f"line {line}: step {step} has an input already; a step is driven by one input: leave one row"
        raise DataFileError([f"{data.path}: {text}"])
    known = inside & ~np.isnan(data.values).any(axis=1)
    return {int(k): u for k, u in zip(steps[known], data.values[known], strict=True)}


def _begun_steps(data: DataFile, configuration: Configuration) -> Integers:
    if data.time_ns is None:
        assert data.steps is not None
        return data.steps
    grid = configuration.grid
    closest = grid.nearest_steps(data.time_ns)
    begun = np.where(grid.times_of(closest) > data.time_ns, closest - 1, closest)
    late = data.time_ns - grid.times_of(begun)
    tolerance = max(1, data.digit_ns // 2) if configuration.continuous is None else 0
    on_grid = np.abs(data.time_ns - grid.times_of(closest)) <= np.maximum(data.time_half_ns, tolerance)
    steps: Integers = np.where(on_grid, closest, begun)
    _refuse_off_grid(data, ~on_grid & (late + data.time_half_ns > configuration.input_delay_ns) & (steps >= 1), late)
    return steps


def _refuse_off_grid(data: DataFile, is_off: Flags, late: Integers) -> None:
    if is_off.any():
        i = int(np.argmax(is_off))
        text = (
            f"line {data.lines[i]}: the input begins {duration_text(int(late[i]))} after a step ({int(is_off.sum())} "
            "such rows); an input acts from the moment of a step on: number the rows by step, choose start_time and dt "
            "that fit them, or declare input_delay of a continuous model"
        )
        raise DataFileError([f"{data.path}: {text}"])

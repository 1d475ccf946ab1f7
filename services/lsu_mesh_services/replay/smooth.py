"""``lsu-mesh replay FILE --smooth L``: a lag for the filters that smooth, and how much later data narrow their sets."""

from __future__ import annotations

import copy
import json
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from lsu_mesh.filters.registry import filter_class
from lsu_mesh.mesh.config import Configuration, load_values
from lsu_mesh.mesh.config.filter_options import FilterOptions
from lsu_mesh.mesh.messages import Message, Posterior, Smoothed
from lsu_mesh_services.monitoring.table import share
from lsu_mesh_services.replay.compare import CannotReplay


def with_lag(configuration: Configuration, lag: int) -> Configuration:
    """The mesh with ``lag`` in every filter of a kind that smooths.

    Each step more is n states and the filter's m outputs more, so the limits of the set are raised by n generators and
    m constraints for each: the newest set would lose by the earlier states otherwise. Raises :class:`CannotReplay`
    where no filter can smooth.
    """
    chosen = [one for one in configuration.filters.values() if filter_class(one.kind).smooths]
    if not chosen:
        kinds = ", ".join(sorted({one.kind for one in configuration.filters.values()}))
        raise CannotReplay(
            f"{configuration.path}: no filter can smooth, its kinds are {kinds}; "
            "give a mesh that has a filter of kind LSUCZ by --with other.toml"
        )
    if configuration.continuous is not None:
        raise CannotReplay(
            f"{configuration.path}: a lag counts time updates, and a step of a continuous model may take several; "
            "give a mesh with a discrete model by --with other.toml"
        )
    values = copy.deepcopy(dict(configuration.values))
    for settings in chosen:
        n, m = configuration.base_model.state_count, sum(len(configuration.sensors[one].C) for one in settings.sensors)
        defaults = {one.name: one.default for one in FilterOptions(filter_class(settings.kind)).parameters}
        changes = {"lag": lag}
        for name, each in (("max_generators", n), ("max_constraints", m)):
            limit = settings.options.get(name, defaults.get(name))
            if isinstance(limit, int):  # without a number there is no limit, or it grows with the lag by itself
                changes[name] = limit + each * (lag - settings.lag)
        values["filters"][settings.name] |= changes
    return load_values(values, configuration.path, reads_files=False)


@dataclass(frozen=True)
class SmoothedRow:
    """The smoothed sets of one filter beside its filtered sets of the same steps; widths are means over the states.

    ``inside``: share of the steps whose truth is known and in every set of the step; ``None``: no truth is known.
    """

    name: str
    lag: int
    steps: int
    inside: float | None
    width: float
    filtered_width: float


def smoothed_rows(made: Sequence[Message], truth: Mapping[int, Sequence[float]]) -> list[SmoothedRow]:
    """One row for each filter that has published smoothed sets."""
    smoothed = [message for message in made if isinstance(message, Smoothed)]
    names = dict.fromkeys(message.name for message in smoothed)
    return [_row([one for one in smoothed if one.name == name], _filtered(made, name), truth) for name in names]


def _filtered(made: Sequence[Message], name: str) -> dict[int, Posterior]:
    return {message.step: message for message in made if isinstance(message, Posterior) and message.name == name}


def _row(
    smoothed: Sequence[Smoothed], filtered: Mapping[int, Posterior], truth: Mapping[int, Sequence[float]]
) -> SmoothedRow:
    newest = {message.step: message for message in smoothed}
    steps = sorted(newest.keys() & filtered.keys())
    known = [step for step in newest if step in truth]
    missed = {one.step for one in smoothed if one.step in truth and not _holds(one, truth[one.step])}
    return SmoothedRow(
        name=smoothed[0].name,
        lag=smoothed[0].lag,
        steps=len(newest),
        inside=1.0 - len(missed) / len(known) if known else None,
        width=_mean_width(newest[step] for step in steps),
        filtered_width=_mean_width(filtered[step] for step in steps),
    )


def _mean_width(sets: Iterable[Smoothed | Posterior]) -> float:
    return float(np.mean([np.subtract(one.upper, one.lower) for one in sets]))


def _holds(message: Smoothed, x: Sequence[float]) -> bool:
    return all(low <= value <= high for low, value, high in zip(message.lower, x, message.upper, strict=True))


def json_lines(rows: Sequence[SmoothedRow]) -> Iterator[str]:
    """One record for each row."""
    for row in rows:
        yield json.dumps({"type": "smoothed", **asdict(row)})


def print_rows(rows: Sequence[SmoothedRow], lag: int) -> None:
    """The rows as a table; why there are none, where there are none."""
    if not rows:
        print(f"no smoothed sets: no filter has gone on for {lag + 1} steps, which a lag of {lag} needs")
        return
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 120, highlight=False)
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("smoothed")
    for title in ("lag", "steps", "truth inside", "mean width", "filtered", "ratio"):
        table.add_column(title, justify="right")
    for row in rows:
        ratio = row.width / row.filtered_width if row.filtered_width else 1.0
        numbers = f"{row.width:.4f}", f"{row.filtered_width:.4f}", f"{ratio:.3f}"
        table.add_row(row.name, str(row.lag), str(row.steps), share(row.inside), *numbers)
    console.print(table)

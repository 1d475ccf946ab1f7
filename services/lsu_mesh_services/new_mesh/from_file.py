"""A mesh that plays a file of measurements: position and speed of each column, with bounds that the data suggest."""

from __future__ import annotations

import json
import re
from fractions import Fraction
from pathlib import Path

from lsu_mesh.mesh.data_files.spans import moment_text, seconds_text
from lsu_mesh_services.new_mesh.survey import Survey

MARGIN = 1.5
"""What was seen is not the most that may come."""
WIDE = 1000
"""Half-widths of the prior, in half-widths of the sensor, at least."""


def file_text(found: Survey, target: Path) -> str:
    """The configuration, commented; ``target`` is where it is written to."""
    return "\n\n".join((_mesh(found), _model(found), _sensor(found, target), _filter(), _recorder())) + "\n"


def _mesh(found: Survey) -> str:
    lines = [
        f"# Plays {found.path.name}. Every number below is a proposal from the data; rho and r are yours to know.",
        "[mesh]",
        f"name = {_text(_name(found.path.stem))}",
        "# seconds between two steps, at which sets are published: the median period of the rows",
        f"dt = {_number(found.dt)}",
    ]
    if found.start_ns is not None:
        lines += [
            f"# one dt before the first row, which is then step 1; in seconds ({moment_text(found.start_ns)})",
            f"start_time = {_start(found.start_ns)}",
        ]
    return "\n".join(lines)


def _model(found: Survey) -> str:
    count = len(found.columns)
    states = [name for column in found.columns for name in (column, f"{column}.speed")]
    prior = [_prior(found, i) for i in range(count)]
    lower = [number for center, half, speed in prior for number in (center - half, -speed)]
    upper = [number for center, half, speed in prior for number in (center + half, speed)]
    return "\n".join(
        [
            "# Position and speed of each column, dx/dt = A x + noise_map w. w is the acceleration, at most rho at",
            "# every moment. So each row is used at its own moment, wherever the steps are.",
            "[model]",
            "continuous = true",
            f"A = {_blocks([[0.0, 1.0], [0.0, 0.0]], count)}",
            f"noise_map = {_blocks([[0.0], [1.0]], count)}",
            "# largest acceleration, in units of the column per s²: a guess from second differences; noise is in it",
            f"rho = {_list([_acceleration(found, i) for i in range(count)])}",
            f"states = {json.dumps(states, ensure_ascii=False)}",
            "",
            "# a box that holds the state at the first row",
            "[model.prior]",
            f"lower = {_list(lower)}",
            f"upper = {_list(upper)}",
        ]
    )


def _sensor(found: Survey, target: Path) -> str:
    rows = [[1.0 if j == 2 * i else 0.0 for j in range(2 * len(found.columns))] for i in range(len(found.columns))]
    left_out = [f"# not used, because they hold no numbers: {', '.join(found.left_out)}"] if found.left_out else []
    return "\n".join(
        [
            "[sensors.data]",
            f"C = {_matrix(rows)}",
            "# half-widths of the noise: half the resolution of the values, so rounding alone;",
            "# a sensor errs by more than that: take its data sheet",
            f"r = {_list([_half_width(found, i) for i in range(len(found.columns))])}",
            f"file = {_text(_relative(found.path, target))}",
            f"{found.indexed_by} = {_text(found.index)}",
            f"columns = {json.dumps(list(found.columns), ensure_ascii=False)}",
            f"outputs = {json.dumps(list(found.columns), ensure_ascii=False)}",
            *left_out,
        ]
    )


def _filter() -> str:
    return "\n".join(
        [
            "# LSUO keeps boxes (fast), LSUP parallelotopes, LSUCZ constrained zonotopes (tight)",
            "[filters.main]",
            'kind = "LSUCZ"',
            'sensors = ["data"]',
        ]
    )


def _recorder() -> str:
    return '[recorder]\npath = "runs/{mesh}-{time}.rrd"'


def _half_width(found: Survey, i: int) -> float:
    return found.resolution[i] / 2 or 1.0


def _acceleration(found: Survey, i: int) -> float:
    """What was seen, or what moves a resolution in a step."""
    return _rounded(MARGIN * found.largest_acceleration[i] or _half_width(found, i) / float(found.dt) ** 2)


def _prior(found: Survey, i: int) -> tuple[float, float, float]:
    """Center and half-width of the position, half-width of the speed."""
    half = WIDE * _half_width(found, i)
    speed = max(2 * MARGIN * found.largest_speed[i], half / float(found.dt) / WIDE)
    return found.first[i], half, _rounded(speed)


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


def _number(value: Fraction) -> str:
    text = seconds_text(round(value * 10**9))
    return text if "." in text else f"{text}.0"


def _start(ns: int) -> str:
    """In seconds; all digits count."""
    text = seconds_text(ns)
    return text if "." in text else f"{text}.0"


def _relative(path: Path, target: Path) -> str:
    """From the folder of the configuration if the file lies in it, else in full."""
    whole, folder = path.resolve(), target.resolve().parent
    return str(whole.relative_to(folder)) if whole.is_relative_to(folder) else str(whole)


def _name(stem: str) -> str:
    """A name of the mesh of a file's name."""
    name = re.sub(r"[^a-z0-9]+", "-", stem.lower()).strip("-")[:32].strip("-")
    return name if name and name[0].isalpha() else f"mesh-{name}".strip("-")


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _list(values: list[float]) -> str:
    return f"[{', '.join(repr(float(f'{value:.15g}')) for value in values)}]"


def _matrix(rows: list[list[float]]) -> str:
    return f"[{', '.join(_list(row) for row in rows)}]"


def _blocks(block: list[list[float]], count: int) -> str:
    """The block ``count`` times on the diagonal."""
    width = len(block[0])
    rows = [
        [0.0] * (width * i) + row + [0.0] * (width * (count - 1 - i)) for i in range(count) for row in block
    ]  # fmt: skip
    return _matrix(rows)

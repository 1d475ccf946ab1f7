"""How wide the altitude was at steps with a report: python widths.py RECORDING FLIGHT.csv.

Reads the raw payloads of a recording, so that it sees exactly what the peers published.
"""

from __future__ import annotations

import csv
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import msgpack
from lsu_mesh_services.recording.read import read_raw

CELL = 25.0
ROUNDING = 1e-9
"""Published bounds are rounded outward: by parts in 1e-13 of the altitude, never by more than this."""
START_UP = 10
"""Steps that are left out at the start."""


class Widths(NamedTuple):
    """Of one publisher: widest altitude and number of steps with a report, and steps by status."""

    name: str
    widest: float
    steps: int
    statuses: Counter[str]


def reported_steps(file: Path) -> set[int]:
    """Steps of a flight that have a report; the first row is step 1."""
    with file.open(encoding="utf-8") as text:
        rows = list(csv.DictReader(text))
    first = float(rows[0]["time"])
    return {round(float(row["time"]) - first) + 1 for row in rows if row["altitude"]}


def widths(recording: Path, reported: set[int]) -> Iterator[Widths]:
    """Widths and statuses of every filter and fusion; the last revision of a step counts."""
    latest: dict[str, dict[int, tuple[str, float]]] = {}
    for message in read_raw(recording):
        topic, name = message.key.split("/")[3:5]
        if topic in ("posterior", "fused"):
            body = msgpack.unpackb(message.payload)
            width = body["upper"][0] - body["lower"][0]
            latest.setdefault(name, {})[body["step"]] = (body["status"], width)
    for name, steps in sorted(latest.items()):
        sound = {step: width for step, (status, width) in steps.items() if status == "ok" and step > START_UP}
        used = [width for step, width in sound.items() if step in reported]
        yield Widths(name, max(used), len(used), Counter(status for status, _ in steps.values()))


def main(arguments: Sequence[str]) -> int:
    if len(arguments) != 2:
        print("usage: widths.py RECORDING FLIGHT.csv", file=sys.stderr)
        return 2
    reported = reported_steps(Path(arguments[1]))
    print(
        f"\naltitude at steps with a report that was used, from step {START_UP + 1} on; the cell is {CELL:g} ft wide:"
    )
    for name, widest, steps, statuses in widths(Path(arguments[0]), reported):
        verdict = "within the cell" if widest <= CELL + ROUNDING else "WIDER than the cell"
        counted = ", ".join(f"{count} {status}" for status, count in sorted(statuses.items()))
        print(f"  {name:5} {steps:6} such steps, widest {widest:.4f} ft: {verdict}; all steps: {counted}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

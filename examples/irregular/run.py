"""Run the mesh on the reports, and count which sets hold the car: at the true times, and on the nearest step.

    python run.py [-- options of lsu-mesh run]

The second mesh is what a model in steps of dt makes of the same file if every report is taken as measured at the step
that is nearest, which is what off_grid = "nearest" says. Its sets say that nothing is guaranteed.
"""

from __future__ import annotations

import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import msgpack
from lsu_mesh_services.recording.read import read_raw
from make_data import HERE, Course, drive

from lsu_mesh.mesh.config.write import to_toml

MESH = HERE / "irregular.toml"


class Held(NamedTuple):
    """Of one publisher: its sets, how many miss the car, by how much (m), and how wide the position is (m)."""

    name: str
    sets: int
    missing: int
    farthest: float
    width: float
    guarantees: frozenset[str]


def main(arguments: list[str]) -> int:
    options = arguments[1:] if arguments[:1] == ["--"] else arguments
    Path("runs").mkdir(exist_ok=True)
    nearest = Path("runs") / "nearest.toml"
    nearest.write_text(to_toml(on_the_nearest_step(tomllib.loads(MESH.read_text(encoding="utf-8")))), encoding="utf-8")
    for words, mesh in (("at the times of the reports", MESH), ("on the nearest step", nearest)):
        recording = Path("runs") / f"{mesh.stem}.rrd"
        recording.unlink(missing_ok=True)
        command = [
            sys.executable,
            "-P",
            "-m",
            "lsu_mesh_services",
            "run",
            str(mesh),
            "--record",
            str(recording),
            *options,
        ]
        code = subprocess.call(command)
        if code:
            return code
        print(f"\n{words}:")
        for held in count(recording, drive()[0]):
            print(
                f"  {held.name:5} {held.sets} sets, {held.missing} miss the car, by up to {held.farthest:.2f} m; "
                f"position ±{held.width / 2:.2f} m; guarantee {', '.join(sorted(held.guarantees))}"
            )
    return 0


def on_the_nearest_step(values: Mapping[str, Any]) -> dict[str, Any]:
    """The same car in steps of dt. With V = ∫ a dt of a step, the position gains dt/2 V and at most 3 dt²/4 besides."""
    dt = values["mesh"]["dt"]
    model = {key: value for key, value in values["model"].items() if key != "continuous"}
    model |= {"A": [[1.0, dt], [0.0, 1.0]], "noise_map": [[dt / 2, dt / 4], [1.0, 0.0]], "rho": [3.0 * dt, 3.0 * dt]}
    sensors = {
        name: sensor | {"file": str(HERE / sensor["file"]), "off_grid": "nearest"}
        for name, sensor in values["sensors"].items()
    }
    return {**values, "model": model, "sensors": sensors, "mesh": values["mesh"] | {"name": "nearest"}}


def count(recording: Path, course: Course, dt: Fraction = Fraction(1, 10)) -> Iterator[Held]:
    """What each publisher's sets are worth; the last revision of a step counts."""
    latest: dict[str, dict[int, dict[str, Any]]] = {}
    for message in read_raw(recording):
        topic, name = message.key.split("/")[3:5]
        if topic in ("posterior", "fused"):
            body = msgpack.unpackb(message.payload)
            latest.setdefault(name, {})[body["step"]] = body
    for name, sets in sorted(latest.items()):
        outside = [_outside(body, course.at(step * dt)) for step, body in sets.items()]
        widths = [body["upper"][0] - body["lower"][0] for body in sets.values()]
        yield Held(
            name, len(sets), sum(far > 0 for far in outside), max(outside), sum(widths) / len(widths),
            frozenset(body["guarantee"] for body in sets.values()),
        )  # fmt: skip


def _outside(body: Mapping[str, Any], state: tuple[Fraction, Fraction]) -> float:
    """How far the position is outside its bounds, or else the speed; 0 where both are inside."""
    gaps = [
        max(Fraction(low) - x, x - Fraction(high))
        for low, x, high in zip(body["lower"], state, body["upper"], strict=True)
    ]
    return float(max(0, *gaps))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

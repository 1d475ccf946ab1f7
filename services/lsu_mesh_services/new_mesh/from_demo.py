"""The packaged demo with a comment at each key."""

from __future__ import annotations

from pathlib import Path

COMMENTS = {
    "mesh.name": "part of every key, so that several meshes share a network",
    "mesh.dt": "seconds between two steps",
    "mesh.steps": "the run ends after so many; leave it out to run until Ctrl-C",
    "mesh.seed": "of the simulated noise: the same seed, the same run",
    "model.A": "x⁺ = A x + B u + w, one row per state",
    "model.B": "one column per input",
    "model.rho": "half-widths of the process noise: |w| ≤ rho, always; what must be right",
    "model.prior.lower": "a box that holds the first state",
    "plant.x1": "the simulated first state; it must lie in the prior",
    "plant.inputs": '"normal", "sine", "zero", or a file',
    "sensors.s1.C": "y = C x + v, one row per output",
    "sensors.s1.r": "half-widths of the sensor's noise: |v| ≤ r, always; what must be right",
    "filters.box.kind": "the sets that the filter keeps: LSUO boxes, LSUP parallelotopes, LSUCZ constrained zonotopes",
    "filters.box.sensors": "whose measurements it uses",
    "filters.cz.max_generators": "larger: tighter sets, longer steps",
    "fusion.main.sources": "filters whose sets are intersected",
    "recorder.path": "open it with lsu-mesh view",
}
"""What stands above the line of a key."""


def demo_text(demo: Path) -> str:
    """The demo's lines, each of the first tables of a kind with its comments."""
    lines, table = [], ""
    for line in demo.read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            table = line.strip("[]")
        comment = COMMENTS.get(f"{table}.{line.partition(' = ')[0]}")
        lines += [line] if comment is None else [f"# {comment}", line]
    return "\n".join(lines) + "\n"

"""Latency and processor time of the mesh as ratios to those of the relay, from turns that were run alternately."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from lsu_mesh.experiments.mesh_speed.mesh_case import MeshCase
from lsu_mesh.experiments.mesh_speed.quantiles import Quantiles, quantiles

MAX_LOST = 0.01
"""A side that loses a larger share of its steps does not keep up."""


class Turn(NamedTuple):
    """One run of the relay or of the mesh over the steps that count."""

    latencies_ms: Sequence[float]
    """Of each step, from its intended time to the arrival of its first fused set; of a step without one, to the end of
    the turn, so that a lost set never makes a mesh look faster."""
    missing: int
    """Steps without a fused set."""
    incomplete: int
    """Steps whose first fused set lacks a source."""
    processor_s: float | None
    """Processor time of all processes between the first and the last of the steps; ``None``: the system tells none."""


class MeshReport(NamedTuple):
    """A case with its ratios mesh ÷ relay."""

    case: MeshCase
    relay: Sequence[Turn]
    mesh: Sequence[Turn]

    def line(self) -> dict[str, Any]:
        """What ``--json`` prints and a file of results keeps; times in milliseconds.

        Quantiles are of the samples of all turns together. ``p50_ratio_least`` and ``p50_ratio_most`` are the extremes
        over the turns, each mesh beside the relay of the same turn: how far a single turn can be trusted.
        """
        relay, mesh = _pooled(self.relay), _pooled(self.mesh)
        cpu, relay_cpu = processor_ms_per_step(self.mesh), processor_ms_per_step(self.relay)
        ratios = [
            quantiles(there.latencies_ms).p50 / quantiles(here.latencies_ms).p50
            for here, there in zip(self.relay, self.mesh, strict=True)
        ]
        return {
            "type": "mesh",
            **self.case._asdict(),
            "turns": len(self.mesh),
            "steps": mesh.samples,
            "p50_ratio": _rounded(mesh.p50 / relay.p50),
            "p99_ratio": _rounded(mesh.p99 / relay.p99),
            "p999_ratio": _rounded(mesh.p999 / relay.p999),
            "p50_ratio_least": _rounded(min(ratios)),
            "p50_ratio_most": _rounded(max(ratios)),
            "cpu_ms_per_step": _rounded(cpu),
            "relay_cpu_ms_per_step": _rounded(relay_cpu),
            "cpu_ratio": _rounded(None if cpu is None or not relay_cpu else cpu / relay_cpu),
            "relay": _side(relay, self.relay),
            "mesh": _side(mesh, self.mesh),
        }


def keeps_up(missing: int, steps: int) -> bool:
    """Whether a side lost so few of its steps that its latencies and costs mean what they say."""
    return missing <= MAX_LOST * steps


def processor_ms_per_step(turns: Sequence[Turn]) -> float | None:
    """Processor time of all processes ÷ steps, over all turns, in milliseconds."""
    seconds = [turn.processor_s for turn in turns if turn.processor_s is not None]
    if len(seconds) < len(turns):
        return None
    return 1e3 * sum(seconds) / sum(len(turn.latencies_ms) for turn in turns)


def _pooled(turns: Sequence[Turn]) -> Quantiles:
    return quantiles([latency for turn in turns for latency in turn.latencies_ms])


def _side(found: Quantiles, turns: Sequence[Turn]) -> dict[str, Any]:
    return {
        "p50_ms": _rounded(found.p50),
        "p99_ms": _rounded(found.p99),
        "p999_ms": _rounded(found.p999),
        "largest_ms": _rounded(found.largest),
        "missing": sum(turn.missing for turn in turns),
        "incomplete": sum(turn.incomplete for turn in turns),
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.4g}")

"""What a filter node tells people of its steps."""

from __future__ import annotations

from lsu_mesh.mesh.estimation.filter_step import FilterOutcome, RejectedTransfer
from lsu_mesh.mesh.estimation.inconsistency import DroppedStrip
from lsu_mesh.mesh.messages import Message
from lsu_mesh.mesh.nodes.node import Node


def dropped_event(node: Node, k: int, strip: DroppedStrip, *, now: int) -> Message:
    """A measured value that was left out, its sensor, its moment where it has one, and by how much it misses."""
    if strip.is_alone:
        why = f"lies {strip.gap:.4g} outside [{strip.lower:.6g}, {strip.upper:.6g}], all that the declared bounds allow"
    else:
        why = "contradicts the prediction together with the step's other measurements"
    when = "" if strip.time_ns is None else f" at {strip.time_ns} ns"
    text = f"step {k}: {strip.output} = {strip.y:.6g} of sensor {strip.sensor}{when} {why}; left out"
    about: dict[str, str | int | float | None] = {
        "sensor": strip.sensor, "output": strip.output, "step": k, "y": strip.y, "lower": strip.lower,
        "upper": strip.upper, "gap": strip.gap if strip.is_alone else None,
    }  # fmt: skip
    if strip.time_ns is not None:
        about["time_ns"] = strip.time_ns
    return node.event("WARN", "contradiction", text, now=now, step=k, about=about)


def rejected_event(node: Node, k: int, rejected: RejectedTransfer, *, now: int) -> Message:
    """A transfer that was left out, its source, and why."""
    source = rejected.message.src
    text = f"step {k}: the transfer from {source} was left out: {rejected.reason}"
    return node.event("WARN", "transfer-rejected", text, now=now, step=k, about={"source": source, "step": k})


def widened_event(node: Node, k: int, outcome: FilterOutcome, *, now: int) -> Message:
    """r was widened in a step, so that it explains the data."""
    widened = f"r was widened by {outcome.factor:.4g} in this step, the set is no longer guaranteed"
    text = f"step {k}: {outcome.error}; {widened}"
    return node.event("WARN", "widened", text, now=now, step=k, about={"step": k, "factor": outcome.factor})

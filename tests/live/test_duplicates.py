"""A sensor and a filter that are started twice: real processes name one another, and the later one is used at last."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import pytest

pytestmark = pytest.mark.live
Start = Callable[..., Any]
COMMON = ("-X", "mesh.steps=1000000")
PATIENCE_S = 90.0


def looked(start: Start, *arguments: str, endpoint: str) -> list[dict[str, Any]]:
    """What a tool prints as JSON lines."""
    session = start(*arguments, "--json", "-e", endpoint, *COMMON, endpoint=endpoint)
    session.wait()
    return [json.loads(line) for line in session.output[0].splitlines()]


def looked_until(start: Start, endpoint: str, met: Callable[[dict[str, dict[str, Any]]], bool]) -> Any:
    """Peers by name, as ``health`` sees them, once they are as they should be."""
    end = time.monotonic() + PATIENCE_S
    while True:
        peers = {peer["name"]: peer for peer in looked(start, "health", endpoint=endpoint)}
        if met(peers):
            return peers
        assert time.monotonic() < end, [(name, peer["step"], peer["reasons"]) for name, peer in peers.items()]


def processes(peers: dict[str, dict[str, Any]], name: str) -> int:
    return len(peers[name]["processes"])


def refused(peer: dict[str, Any]) -> float:
    return float(peer["counters"].get("refused.duplicate publisher", 0.0))


def test_a_sensor_and_a_filter_that_run_twice_are_named_until_one_is_gone(start: Start) -> None:
    plant = start("plant", "-l", "{endpoint}", "-X", "network.entry={endpoint}", *COMMON)
    at = plant.process.args[plant.process.args.index("-l") + 1]
    start("fusion", "main", "-e", at, *COMMON)  # it gives the second filter a set to start from
    first = {name: start(role, name, "-e", at, *COMMON) for role, name in (("sensor", "s1"), ("filter", "para"))}
    looked_until(start, at, lambda peers: peers["para"]["step"] > 10)
    second = {name: start(role, name, "-e", at, *COMMON) for role, name in (("sensor", "s1"), ("filter", "para"))}
    peers = looked_until(
        start,
        at,
        lambda peers: (
            processes(peers, "s1") == processes(peers, "para") == 2
            and refused(peers["para"]) > 0
            and refused(peers["main"]) > 0
        ),
    )
    for name in ("s1", "para"):
        assert peers[name]["level"] == "WARN"
        assert any(reason.startswith("2 processes: on ") for reason in peers[name]["reasons"])
    named = [reason for reason in peers["para"]["reasons"] if "2 processes of sensor/s1 publish" in reason]
    assert named
    assert all(reason.startswith("2 processes") for reason in named), "not again with what is refused for it"
    told = looked(start, "list", endpoint=at)
    counts = {line["name"]: len(line["processes"]) for line in told if line["type"] == "peer"}
    assert (counts["s1"], counts["para"], counts["plant"]) == (2, 2, 1)
    rows = {row["name"]: row for row in looked(start, "top", endpoint=at)}
    assert len(rows["para"]["processes"]) == 2

    for session in first.values():
        session.process.kill()
    step = peers["main"]["step"]
    peers = looked_until(
        start,
        at,
        lambda peers: (
            processes(peers, "s1") == processes(peers, "para") == 1
            and peers["main"]["step"] > step + 100
            and not any("processes" in reason for name in ("para", "main") for reason in peers[name]["reasons"])
        ),
    )
    assert peers["para"]["counters"]["gaps"] == 0
    for session in (*first.values(), *second.values()):
        if session.process.poll() is None:
            session.process.terminate()
        session.wait()
        assert "another process of this name runs on " in session.output[1], session.output

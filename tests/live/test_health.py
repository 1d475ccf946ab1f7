"""``lsu-mesh health`` on a running mesh: well, then with a frozen filter, by real heartbeats."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable
from typing import Any

import pytest

Start = Callable[..., Any]
PEERS = {"recorder", "main", "box", "cz", "para", "s1", "s2", "s3", "plant"}
PATIENCE_S = 120.0


def looked(start: Start, endpoint: str) -> tuple[int, dict[str, dict[str, Any]]]:
    """Exit code and peers of one look."""
    session = start("health", "--json", "-e", endpoint, endpoint=endpoint)
    code = session.wait()
    return code, {peer["name"]: peer for peer in map(json.loads, session.output[0].splitlines())}


def looked_until(start: Start, endpoint: str, wanted: Callable[[dict[str, dict[str, Any]]], bool]) -> Any:
    """Look again until the peers are as they should be."""
    end = time.monotonic() + PATIENCE_S
    while True:
        code, peers = looked(start, endpoint)
        if wanted(peers) or time.monotonic() > end:
            return code, peers


@pytest.mark.live
def test_a_frozen_filter_is_stale_and_the_others_are_seen(start: Start) -> None:
    mesh = start("run", "--steps", "30000", "--json", "--record", "run.rrd", "-X", "network.entry={endpoint}")
    _, peers = looked_until(start, mesh.endpoint, lambda seen: seen.get("cz", {}).get("step", 0) > 10)
    assert set(peers) == PEERS
    assert peers["cz"]["counters"]["received"] > 10
    assert {"queue", "step_ms", "links", "gaps", "duplicates"} <= set(peers["cz"]["counters"])
    assert all(peer["level"] != "STALE" for peer in peers.values()), peers
    mesh.child("filter cz").send_signal(signal.SIGSTOP)
    code, peers = looked_until(start, mesh.endpoint, lambda seen: seen.get("cz", {}).get("level") == "STALE")
    assert code == 4
    assert peers["cz"]["level"] == "STALE"
    assert peers["box"]["level"] != "STALE"
    mesh.child("filter cz").send_signal(signal.SIGCONT)
    mesh.process.send_signal(signal.SIGINT)
    assert mesh.wait() == 0

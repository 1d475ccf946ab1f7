"""Processes and tools that are connected to nobody say so within a second, with the reason, and when it changes."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Any

import pytest

pytestmark = pytest.mark.live
Start = Callable[..., Any]
COMMON = ("-X", "mesh.steps=1000000")


def line_of(session: Any, words: str) -> str:
    """The first line on stderr that holds words."""
    while words not in (line := session.process.stderr.readline()):
        assert line, f"no {words!r}"
    return str(line).strip()


def test_a_peer_says_that_nobody_listens_where_it_tries_and_then_to_how_many_it_is_connected(start: Start) -> None:
    sensor = start("sensor", "s1", "-e", "{endpoint}", *COMMON)
    at = sensor.process.args[sensor.process.args.index("-e") + 1]
    assert line_of(sensor, "connected") == f"sensor s1: connected to nobody, trying {at}; connection refused"
    plant = start("plant", "-l", at, "-X", f"network.entry={at}", *COMMON)
    assert line_of(plant, "on the mesh").startswith("plant plant: on the mesh: connected to ")
    said = line_of(sensor, "on the mesh")
    assert re.fullmatch(r"sensor s1: on the mesh: connected to (1 peer|2 peers)", said), "a second one mends links"
    plant.process.kill()
    began = time.monotonic()
    assert "sensor s1: connected to nobody" in line_of(sensor, "connected")
    assert time.monotonic() - began < 30.0, "the lease of a link is 2 s; a busy machine needs more"


@pytest.mark.parametrize("who", [("filter", "box"), ("fusion", "main"), ("recorder",), ("sensor", "s2")])
def test_a_host_that_nobody_knows_is_told(start: Start, who: tuple[str, ...]) -> None:
    peer = start(*who, "-e", "tcp/no-such-host.invalid:7447", *COMMON)
    expected = "connected to nobody, trying tcp/no-such-host.invalid:7447; name not known"
    assert line_of(peer, "connected").endswith(expected)


@pytest.mark.parametrize(
    "tool",
    [("echo", "fused/main"), ("hz", "fused/main"), ("top", "--once"), ("health",), ("list",), ("graph", "--live")],
)
def test_a_tool_that_is_connected_to_nobody_says_so(start: Start, tool: tuple[str, ...]) -> None:
    session = start(*tool, "-e", "{endpoint}")
    session.wait()
    at = session.process.args[-1]
    lines = session.output[1].splitlines()
    assert f"{tool[0]}: connected to nobody, trying {at}; connection refused" in lines, session.output

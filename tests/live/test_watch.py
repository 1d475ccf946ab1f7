"""``lsu-mesh list echo hz top graph --live`` on a real mesh, and what ``health`` says of a peer that waits."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import signal
import subprocess
import termios
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.live
Start = Callable[..., Any]
PEERS = {"recorder", "main", "box", "cz", "para", "s1", "s2", "s3", "plant"}


def told(start: Start, *arguments: str, endpoint: str) -> tuple[int, str, str]:
    """Exit code and output of one tool."""
    session = start(*arguments, "-e", endpoint, endpoint=endpoint)
    code = session.wait()
    return code, *session.output


def lines(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines()]


@pytest.fixture
def mesh(start: Start) -> Iterator[Any]:
    """The demo, running beyond the last step of its configuration, as a tool's own configuration cannot know."""
    session = start("run", "--steps", "30000", "--json", "--no-record", "-X", "network.entry={endpoint}")
    session.child("plant plant")
    code, _, words = told(start, "echo", "fused/main", "-n", "1", "--timeout", "90", endpoint=session.endpoint)
    while code == 4 and "nobody" in words:  # the entry is not there yet
        code, _, words = told(start, "echo", "fused/main", "-n", "1", "--timeout", "90", endpoint=session.endpoint)
    assert code == 0, words
    yield session
    session.process.send_signal(signal.SIGINT)
    assert session.wait() == 0


def test_the_tools_see_a_running_mesh(start: Start, mesh: Any, lsu_mesh_command: list[str], root: Path) -> None:
    at = mesh.endpoint
    code, out, _ = told(start, "list", "--json", endpoint=at)
    assert code == 0
    assert {line["name"] for line in lines(out) if line["type"] == "peer" and line["there"]} == PEERS - {"recorder"}
    rates = {f"{line['topic']}/{line['name']}": line["rate_hz"] for line in lines(out) if line["type"] == "key"}
    assert {"truth/plant", "measurement/s3", "posterior/cz", "fused/main", "health/box"} <= set(rates)
    assert 5 < rates["truth/plant"] < 250, "50 Hz, on a machine that may be busy"

    code, out, _ = told(start, "echo", "posterior", "-n", "6", "--json", endpoint=at)
    assert code == 0
    assert len(lines(out)) == 6
    assert {line["name"] for line in lines(out)} <= {"box", "cz", "para"}
    assert all(len(line["message"]["lower"]) == 3 for line in lines(out))

    code, out, _ = told(start, "echo", "posterior/cz", "--field", "support.type", "-n", "2", endpoint=at)
    assert (code, out) == (0, "constrained_zonotope\nconstrained_zonotope\n")

    code, _, words = told(start, "echo", "posterior/cz", "--field", "upper.7", "-n", "1", endpoint=at)
    assert code == 2
    assert "upper has 3 items" in words

    code, out, _ = told(start, "hz", "measurement", "--seconds", "2", "--json", endpoint=at)
    assert code == 0
    assert {line["key"] for line in lines(out)} == {"measurement/s1", "measurement/s2", "measurement/s3"}
    for line in lines(out):
        assert 5 < line["rate_hz"] < 250
        assert 0 < line["latency_p50_ms"] <= line["latency_p99_ms"]

    code, out, _ = told(start, "top", "--json", endpoint=at)
    rows = {line["name"]: line for line in lines(out)}
    assert set(rows) == PEERS
    assert (rows["recorder"]["level"], code) == ("STALE", 4), "it was not started"
    assert rows["cz"]["step"] > 10
    assert rows["cz"]["rate_hz"] > 1
    assert rows["cz"]["step_ms"] > 0

    code, out, _ = told(start, "graph", "--live", endpoint=at)
    assert code == 0
    assert "filter cz – there" in out
    assert "recorder – not there" in out

    assert top_on_a_terminal(at, lsu_mesh_command, root) == 0


def top_on_a_terminal(endpoint: str, lsu_mesh_command: list[str], root: Path) -> int:
    """The exit code of ``top`` after it has drawn a few times and was interrupted."""
    terminal, other_end = pty.openpty()
    termios.tcsetwinsize(terminal, (40, 130))
    environment = {**os.environ, "PYTHONPATH": str(root), "TERM": "xterm"}
    command = [*lsu_mesh_command, "top", "-e", endpoint]
    with subprocess.Popen(command, stdout=other_end, stderr=other_end, stdin=other_end, env=environment) as process:
        os.close(other_end)
        shown = b""
        while not (shown.count(b"the mesh:") > 2 and b"fusion" in shown):  # drawn again and again
            shown += os.read(terminal, 65536)
        process.send_signal(signal.SIGINT)
        with contextlib.suppress(OSError):  # its end is the end of the terminal
            while os.read(terminal, 65536):
                pass
    os.close(terminal)
    return process.returncode


def test_a_tool_that_finds_nobody_says_where_it_looked(start: Start) -> None:
    session = start("list", "-e", "{endpoint}")
    session.endpoint = session.process.args[-1]
    assert session.wait() == 4
    assert f"no peer of mesh 'demo' answers at {session.endpoint}" in session.output[1]


def test_a_wrong_topic_is_a_mistake_of_usage(start: Start) -> None:
    session = start("hz", "posteriors/cz")
    assert session.wait() == 2
    assert 'did you mean "posterior/cz"?' in session.output[1]


def test_a_peer_that_waits_says_for_what_key(start: Start) -> None:
    """A filter that comes an hour late, without anyone who could tell it a set to start from."""
    an_hour_ago = str(time.time_ns() - 3600 * 10**9)
    common = ("-X", "mesh.steps=1000000")
    plant = start("plant", "-l", "{endpoint}", "--start-at", an_hour_ago, *common)
    at = plant.process.args[plant.process.args.index("-l") + 1]
    for role, name in (("sensor", "s1"), ("filter", "para")):
        start(role, name, "-e", at, *common)
    end = time.monotonic() + 90
    while True:
        code, out, _ = told(start, "health", "--json", "--seconds", "2", *common, endpoint=at)
        para = {line["name"]: line for line in lines(out)}["para"]
        if any("waiting" in reason for reason in para["reasons"]) or time.monotonic() > end:
            break
    assert code == 4
    assert para["level"] in ("WARN", "ERROR")
    (words,) = [reason for reason in para["reasons"] if "waiting" in reason]
    assert "lsu/v1/demo/last/para" in words
    assert "lsu/v1/demo/input/plant" in words

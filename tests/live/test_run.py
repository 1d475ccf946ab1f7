"""``lsu-mesh run`` with real processes and real sessions."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import msgpack
import numpy as np
import psutil
import pytest
from lsu_mesh_services.exit_codes import USAGE

pytestmark = pytest.mark.live

Start = Callable[..., object]


def until_steps_flow(session, timeout: float = 90.0) -> None:  # type: ignore[no-untyped-def]
    """Wait for the first fused set on the mesh."""
    from lsu_mesh_services.bus import Bus, Clock, SessionSettings

    end = time.monotonic() + timeout
    with Bus(SessionSettings(connect=(session.endpoint,)), Clock()) as bus:
        bus.subscribe("lsu/v1/*/fused/*")
        while bus.next(0.2) is None:
            assert time.monotonic() < end, "no fused set came"
            assert session.process.poll() is None, session.process.communicate()


def test_the_demo_holds_the_truth_in_every_step_and_leaves_no_process(start_run) -> None:  # type: ignore[no-untyped-def]
    session = start_run("--steps", "150", "--record", "demo.rrd")
    until_steps_flow(session)
    children = session.children()
    assert len(children) >= 9, [" ".join(child.cmdline()) for child in children]
    assert session.wait() == 0, session.output[1]
    assert not any(psutil.pid_exists(child.pid) and child.is_running() for child in children)
    rows = {row["name"]: row for row in session.of("estimator")}
    assert set(rows) == {"box", "para", "cz", "main"}
    for row in rows.values():
        assert row["inside"] == 1.0, row
        assert row["steps"] == 150, row
        assert row["gaps"] == 0, row
        assert row["refused"] == 0, row
    assert rows["main"]["width"] < min(rows[name]["width"] for name in ("box", "para", "cz"))
    assert (session.folder / "demo.rrd").stat().st_size > 10_000
    (run,) = session.of("run")
    assert run["recording"] == "demo.rrd"


def test_one_interrupt_ends_the_run_cleanly_with_a_readable_recording(start_run) -> None:  # type: ignore[no-untyped-def]
    from lsu_mesh_services.recording.read import read_raw

    session = start_run("--record", "cut.rrd")
    until_steps_flow(session)
    children = session.children()
    session.process.send_signal(signal.SIGINT)
    asked = time.monotonic()
    assert session.wait() == 0, session.output[1]
    assert time.monotonic() - asked < 15
    assert not any(child.is_running() for child in children)
    assert 0 < session.of("estimator")[0]["last_step"] < 600
    keys = {key for key, _, _ in read_raw(session.folder / "cut.rrd")}
    assert "lsu/v1/demo/fused/main" in keys


def test_the_others_go_on_when_a_filter_is_killed_and_the_run_says_so(start_run) -> None:  # type: ignore[no-untyped-def]
    session = start_run("--steps", "600", "--record", "killed.rrd")
    until_steps_flow(session)
    session.child("filter box").kill()
    assert session.wait() == 0, session.output[1]
    rows = {row["name"]: row for row in session.of("estimator")}
    for name in ("para", "cz", "main"):
        assert rows[name]["steps"] >= 400, "a busy machine finishes steps without publishing them"
    for row in rows.values():
        assert row["inside"] == 1.0, row
    assert rows["box"]["restarts"] == 1
    assert rows["box"]["last_step"] == 600, "it joined again"
    (run,) = session.of("run")
    assert any("filter box ended (killed by SIGKILL)" in words for words in run["happened"])
    assert any("filter box was started again" in words for words in run["happened"])


def test_a_subscriber_of_ten_lines_sees_fused_bounds_that_hold_the_truth(start_run, root: Path) -> None:  # type: ignore[no-untyped-def]
    from lsu_mesh_services.recording.read import read_raw

    session = start_run("--steps", "250", "--record", "heard.rrd")
    command = [sys.executable, str(root / "examples" / "subscribe.py"), session.endpoint]
    subscriber = subprocess.Popen(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert session.wait() == 0, session.output[1]
    subscriber.send_signal(signal.SIGINT)
    lines, complaints = subscriber.communicate(timeout=20)
    assert complaints == ""
    raw = ((key, msgpack.unpackb(payload)) for key, _, payload in read_raw(session.folder / "heard.rrd"))
    truth = {message["step"]: message["x"] for key, message in raw if "/truth/" in key}
    assert len(lines.splitlines()) >= 250, "it waited for the mesh and missed nothing"
    for line in lines.splitlines():
        step, *intervals = re.findall(r"(?<=step) +\d+|-?\d+\.\d+", line)
        bounds = np.array(intervals, dtype=float).reshape(-1, 2)
        x, rounding = np.array(truth[int(step)]), 5e-5  # four decimals are printed
        assert (bounds[:, 0] - rounding <= x).all(), line
        assert (x <= bounds[:, 1] + rounding).all(), line


def test_garbage_and_foreign_messages_are_refused_and_nobody_dies(start_run) -> None:  # type: ignore[no-untyped-def]
    from lsu_mesh_services.bus import Bus, Clock, SessionSettings

    session = start_run("--steps", "300", "--no-record")
    until_steps_flow(session)
    settings = SessionSettings(connect=(session.endpoint,))
    with Bus(settings, Clock()) as bus:
        end = time.monotonic() + 2.0
        while time.monotonic() < end:
            for topic, name in (("measurement", "s1"), ("posterior", "box"), ("input", "plant"), ("measurement", "s2")):
                bus.publish(f"lsu/v1/demo/{topic}/{name}", b"\x00garbage\xff" * 20, "application/octet-stream")
            time.sleep(0.05)
    assert session.wait() == 0, session.output[1]
    rows = {row["name"]: row for row in session.of("estimator")}
    for row in rows.values():
        assert row["inside"] == 1.0
        assert row["last_step"] == 300
        assert row["refused"] > 0
        assert row["restarts"] == 0


def test_a_taken_port_is_an_error_that_says_how_to_choose_another(start) -> None:  # type: ignore[no-untyped-def]
    import socket

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        endpoint = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        session = start("run", "--no-record", "-X", "network.entry={endpoint}", endpoint=endpoint)
        assert session.wait() == 3
    assert "network.entry" in session.output[1]


def test_a_wrong_configuration_starts_nothing(start, tmp_path: Path, demo: Path) -> None:  # type: ignore[no-untyped-def]
    text = demo.read_text().replace('kind = "LSUP"', 'kind = "LSUX"').replace('["s2", "s3"]', '["s2", "s4"]')
    (tmp_path / "wrong.toml").write_text(text)
    session = start("run", "wrong.toml")
    assert session.wait() == 2
    assert "[filters.para] kind" in session.output[1]
    assert "[filters.cz] sensors" in session.output[1]
    assert "2 mistakes; nothing was started" in session.output[1]


def test_a_recording_that_cannot_be_written_is_said_before_anything_runs(start_run) -> None:  # type: ignore[no-untyped-def]
    session = start_run("--record", "/proc/nowhere/demo.rrd")
    assert session.wait() == 3
    assert "/proc/nowhere" in session.output[1]


SIGNALS = pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["INT", "TERM"])
ROLES = ["plant plant", "sensor s1", "filter cz", "fusion main", "recorder", "router router"]
SOON_S = 30.0
"""Idle machines need 3 s at most (see the table of faults); a test leaves loaded ones more."""


@SIGNALS
@pytest.mark.parametrize("role", ROLES)
def test_a_lone_peer_stops_cleanly_when_asked(start, role: str, number: signal.Signals) -> None:  # type: ignore[no-untyped-def]
    listen = ("-l", "{endpoint}") if role.startswith("router") else ()
    session = start(*role.split(), *listen)
    assert session.process.stderr is not None
    assert session.process.stderr.readline().startswith(role.split()[0]), "the line that says it is on the mesh"
    session.process.send_signal(number)
    assert session.wait(SOON_S) == 0, session.output[1]


@SIGNALS
def test_a_peer_that_is_asked_to_stop_while_it_starts_stops_cleanly(start, number: signal.Signals) -> None:  # type: ignore[no-untyped-def]
    session = start("filter", "cz")
    end = time.monotonic() + SOON_S
    while not _catches(session.process.pid):
        assert time.monotonic() < end
        time.sleep(0.002)
    session.process.send_signal(number)
    assert session.wait(SOON_S) == 0, session.output[1]


def _catches(pid: int) -> bool:
    """Whether the process has its handlers: Python itself has none for SIGTERM."""
    status = Path(f"/proc/{pid}/status").read_text()
    caught = next(line for line in status.splitlines() if line.startswith("SigCgt:"))
    return bool(int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1)


def test_options_that_only_the_class_of_a_filter_refuses_are_said_once(start_run) -> None:  # type: ignore[no-untyped-def]
    """The launcher makes no filter, so that it needs no kernel; the filter says it, and nobody is started again."""
    session = start_run("--no-record", "-X", "filters.cz.max_generators=1")
    assert session.wait() == USAGE, session.output[1]
    assert session.output[1].count("must be at least 3, the number of states, it is 1") == 1
    assert "was started again" not in session.output[1]
    assert not session.children()

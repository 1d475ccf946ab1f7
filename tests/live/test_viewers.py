"""``lsu-mesh run --view`` and ``--web``: viewers come and go, the run does without them."""

from __future__ import annotations

import time
import urllib.request
from pathlib import Path
from urllib.error import URLError

import psutil
import pytest
from headless_viewer import why_not
from live_viewers import PHASES, measure
from lsu_mesh_services.recording.read import read_raw
from lsu_mesh_services.viewers import Viewer, free_port

pytestmark = pytest.mark.live


def page(port: int, timeout: float = 90.0) -> str:
    """The page of the web viewer, as soon as it is served."""
    end = time.monotonic() + timeout
    while True:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=5) as answer:
                return str(answer.read().decode())
        except (URLError, ConnectionError, TimeoutError):
            assert time.monotonic() < end, "no page"
            time.sleep(0.1)


def test_the_web_viewer_is_served_on_the_loopback_alone_and_ends_with_the_run(start_run) -> None:  # type: ignore[no-untyped-def]
    port = free_port()
    session = start_run("--steps", "300", "--rate", "25", "--record", "web.rrd", "--web", str(port))
    assert "<html" in page(port)
    viewer = session.child("--serve-web")
    processes = [viewer, *viewer.children(), session.child("recorder recorder")]
    listening = [c.laddr for p in processes for c in p.net_connections("tcp") if c.status == psutil.CONN_LISTEN]
    assert len(listening) >= 2
    assert {address.ip for address in listening} == {"127.0.0.1"}
    whole = [viewer, *viewer.children()]  # Rerun's script and its program
    assert len(whole) == 2
    for process in whole:
        process.suspend()
    time.sleep(1.0)
    for process in whole:
        process.kill()
    assert session.wait() == 0, session.output[1]
    assert "http://127.0.0.1" in session.output[1]
    assert any("the viewer ended" in words for words in session.of("run")[0]["happened"])
    steps = [m for m in read_raw(session.folder / "web.rrd") if "/truth/" in m.key]
    assert len(steps) == 300, "a viewer that freezes and dies leaves no gap"


def test_the_web_viewer_ends_with_all_its_processes() -> None:
    viewer = Viewer(free_port(), is_web=True, web_port=free_port())
    assert "http://127.0.0.1" in viewer.open()
    assert viewer.process is not None
    page(viewer.web_port)
    script = psutil.Process(viewer.process.pid)
    whole = [script, *script.children(recursive=True)]
    assert len(whole) == 2
    viewer.close()
    _, alive = psutil.wait_procs(whole, timeout=10.0)
    for process in alive:
        process.kill()
    assert alive == []


def test_a_native_viewer_without_a_display_is_said_and_changes_nothing(start_run, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    session = start_run("--steps", "150", "--record", "view.rrd", "--view")
    assert session.wait() == 0, session.output[1]
    assert any("no display?" in words for words in session.of("run")[0]["happened"])
    assert {row["last_step"] for row in session.of("estimator")} == {150}


@pytest.mark.viewer
@pytest.mark.skipif(why_not() is not None, reason=why_not() or "")
def test_a_viewer_attached_frozen_and_killed_delays_nothing_and_leaves_no_gap(tmp_path: Path) -> None:
    """Wide limits, for busy machines; ``benchmarks/viewers.py`` measures."""
    outcome = measure(tmp_path, seconds=2.0, rate=25.0)
    assert tuple(outcome.phases) == PHASES
    assert outcome.gaps == []
    assert outcome.messages > 1000
    without = outcome.phases["no viewer"]
    for phase in outcome.phases.values():
        assert phase.missing == 0, phase
        assert phase.steps > 10, phase
        assert phase.p50_ms < 5.0 * without.p50_ms + 200.0, (phase, without)
        assert phase.longest_pause_ms < 3.0 * without.longest_pause_ms + 2000.0, (phase, without)
    assert outcome.recorded_steps >= sum(phase.steps for phase in outcome.phases.values())

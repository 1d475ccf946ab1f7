"""Forked peers: they are supervised like started ones, and end when their server does."""

from __future__ import annotations

import os
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest
from lsu_mesh_services.exit_codes import FAILURE, USAGE
from lsu_mesh_services.forking import CAN_FORK
from lsu_mesh_services.supervisor import Child, Supervisor

from lsu_mesh.mesh.config.settings import SupervisorSettings

pytestmark = [pytest.mark.live, pytest.mark.skipif(not CAN_FORK, reason="only Linux forks")]

LONG_S = 60.0
"""A loaded machine imports slowly."""
THREADED = """
import threading, time
from lsu_mesh import LSUO
threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
class Threaded(LSUO):
    kind = "threaded:Threaded"
"""


def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@pytest.fixture
def supervisor() -> Iterator[Supervisor]:
    made = Supervisor(SupervisorSettings(restart=True, backoff=0.05, limit=2), forks=True)
    yield made
    made.kill()


def until(condition: Callable[[], object], supervisor: Supervisor) -> list[str]:
    """Look after the children until the condition holds; what has happened."""
    happened: list[str] = []
    end = time.monotonic() + LONG_S
    while not condition():
        assert time.monotonic() < end, [child.last_words() for child in supervisor.children]
        happened += [said for _, said in supervisor.watch(time.monotonic())]
        time.sleep(0.02)
    return happened


def router(supervisor: Supervisor) -> Child:
    child = supervisor.start("router", "router", ["-l", endpoint()])
    until(lambda: "listening" in child.last_words(), supervisor)
    return child


def process_of(child: Child) -> psutil.Process:
    assert child.process is not None
    assert child.process.poll() is None
    assert child.process.pid is not None
    return psutil.Process(child.process.pid)


def test_a_forked_peer_shows_its_own_command_and_is_started_again(supervisor: Supervisor) -> None:
    child = router(supervisor)
    first = process_of(child)
    assert first.ppid() != os.getpid(), "it is a child of the server"
    assert first.cmdline()[:6] == [sys.executable, "-P", "-m", "lsu_mesh_services", "router", "router"]
    assert os.getsid(first.pid) == first.pid, "Ctrl-C at the terminal does not reach it"
    first.kill()
    happened = until(lambda: child.restarts == 1, supervisor)
    assert happened == ["router ended (killed by SIGKILL)", "router was started again"]
    until(lambda: "listening" in child.last_words(), supervisor)
    assert process_of(child).pid != first.pid


def test_the_exit_code_and_the_last_words_arrive(supervisor: Supervisor) -> None:
    child = supervisor.start("filter", "nobody", [])
    assert child.process is not None
    process = child.process
    until(lambda: process.poll() is not None, supervisor)
    assert process.returncode == USAGE
    until(lambda: "there is no filter 'nobody'" in child.last_words(), supervisor)


def test_stopping_is_clean_and_leaves_nothing(supervisor: Supervisor) -> None:
    child = router(supervisor)
    child.role = "plant"  # roles decide the order of stopping
    process = process_of(child)
    server = psutil.Process(process.ppid())
    assert supervisor.stop() == []
    supervisor.kill()
    psutil.wait_procs([process, server], timeout=10)
    assert not process.is_running()
    assert not server.is_running()


def test_peers_end_without_their_server_and_are_started_without_one(supervisor: Supervisor) -> None:
    child = router(supervisor)
    first = process_of(child)
    psutil.Process(first.ppid()).send_signal(signal.SIGKILL)
    happened = until(lambda: child.restarts == 1, supervisor)
    assert happened[0] == f"router ended (exit code {FAILURE})"
    psutil.wait_procs([first], timeout=10)
    assert not first.is_running(), "an orphan ends"
    until(lambda: "listening" in child.last_words() or child.restarts == 2, supervisor)
    assert process_of(child).ppid() == os.getpid()


def test_a_server_in_which_a_filter_has_started_a_thread_forks_nothing_more(
    demo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "threaded.py").write_text(THREADED)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    supervisor = Supervisor(SupervisorSettings(), forks=True)
    try:
        options = ["-c", str(demo), "-X", 'filters.box.kind="threaded:Threaded"', "-l", endpoint(), "-e", endpoint()]
        child = supervisor.start("filter", "para", options)
        until(lambda: getattr(child.process, "pid", None), supervisor)
        assert process_of(child).ppid() == os.getpid(), "started as a program of its own"
    finally:
        supervisor.kill()

"""The supervisor: restarts what dies, gives up in the end, stops its own children and no others."""

from __future__ import annotations

import signal
import socket
import time
from collections.abc import Iterator

import psutil
import pytest
from lsu_mesh_services.supervisor import Child, Supervisor

from lsu_mesh.mesh.config.settings import SupervisorSettings

pytestmark = pytest.mark.live


def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@pytest.fixture
def supervisor() -> Iterator[Supervisor]:
    made = Supervisor(SupervisorSettings(restart=True, backoff=0.05, limit=1))
    yield made
    made.kill()


def watch_until(supervisor: Supervisor, words: str, timeout: float = 20.0) -> list[str]:
    """Look after the children until something with ``words`` has happened."""
    happened: list[str] = []
    end = time.monotonic() + timeout
    while not any(words in said for said in happened):
        assert time.monotonic() < end, (words, happened)
        happened += [said for _, said in supervisor.watch(time.monotonic())]
        time.sleep(0.01)
    return happened


def wait_for_words(child: Child, words: str, timeout: float = 20.0) -> None:
    end = time.monotonic() + timeout
    while words not in child.last_words():
        assert time.monotonic() < end, child.last_words()
        time.sleep(0.02)


def test_a_killed_child_is_started_again_until_the_limit(supervisor: Supervisor) -> None:
    child = supervisor.start("router", "router", ["-l", endpoint()])
    wait_for_words(child, "listening")
    assert child.process is not None
    child.process.kill()
    watch_until(supervisor, "was started again")
    assert child.restarts == 1
    child.process.kill()
    happened = watch_until(supervisor, "is not started again")
    assert "killed by SIGKILL" in happened[-1]
    assert child.given_up


def test_the_last_words_of_a_child_that_fails_are_kept(supervisor: Supervisor) -> None:
    child = supervisor.start("filter", "nobody", [])
    watch_until(supervisor, "exit code 2")
    assert "there is no filter 'nobody'" in child.last_words()


def test_stopping_is_clean_and_leaves_nothing(supervisor: Supervisor) -> None:
    children = [supervisor.start("router", "router", ["-l", endpoint()]) for _ in range(2)]
    for child in children:
        wait_for_words(child, "listening")
        child.role = "plant"  # roles decide the order of stopping
    pids = [child.process.pid for child in children if child.process is not None]
    assert supervisor.stop() == []
    assert not any(psutil.pid_exists(pid) for pid in pids)


def test_a_frozen_child_is_killed_when_it_does_not_stop(
    supervisor: Supervisor, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lsu_mesh_services.supervisor.PATIENCE_S", {"plant": 0.3})
    child = supervisor.start("router", "router", ["-l", endpoint()])
    wait_for_words(child, "listening")
    child.role = "plant"
    assert child.process is not None
    child.process.send_signal(signal.SIGSTOP)
    (complaint,) = supervisor.stop()
    assert "did not stop when asked" in complaint
    assert child.process.poll() is not None


def test_children_end_when_their_supervisor_is_gone() -> None:
    import subprocess
    import sys

    program = (
        "import time; from lsu_mesh_services.supervisor import Supervisor; "
        "from lsu_mesh.mesh.config.settings import SupervisorSettings; "
        f"s = Supervisor(SupervisorSettings()); c = s.start('router', 'router', ['-l', '{endpoint()}']); "
        "print(c.process.pid, flush=True); time.sleep(60)"
    )
    parent = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    pid = int(parent.stdout.readline())
    child = psutil.Process(pid)
    time.sleep(1.5)
    parent.kill()
    parent.communicate()
    _, alive = psutil.wait_procs([child], timeout=10)
    assert not alive

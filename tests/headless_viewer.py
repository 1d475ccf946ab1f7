"""The real Rerun viewer without a screen: opens a recording, switches tabs, takes pictures, tells its complaints."""

from __future__ import annotations

import ctypes.util
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

from lsu_mesh_services.recording.rerun_programs import quiet_environment
from rerun.experimental import ViewerClient

VULKAN_DRIVERS = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d")
PATIENCE_S = 60.0
HARMLESS = ("Software rasterizer detected", "Failed to render screenshot requested")
"""Warnings about the machine, not about the recording."""
GLIDE_S, SLOWEST_S = 0.5, 10.0
"""Plots glide to their ranges. Pictures so far apart that are equal show that they are there; the longest to wait."""
TOASTS_S = 6.0
"""How long the viewer's own greetings cover a corner."""


def why_not() -> str | None:
    """Why the viewer cannot run here, or ``None``."""
    if _vulkan_driver() is None or ctypes.util.find_library("vulkan") is None:
        return "no software Vulkan here (Debian: apt-get install mesa-vulkan-drivers libvulkan1)"
    return None


class HeadlessViewer:
    """One viewer process, stopped at the end of the ``with`` block."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="viewer-")
        self._port = free_port()
        self._process: subprocess.Popen[bytes] | None = None
        self._client: ViewerClient | None = None
        self._started = 0.0
        self._received_at: int | None = None

    @property
    def home(self) -> Path:
        """Where this viewer keeps its settings and data."""
        return Path(self._folder.name)

    def __enter__(self) -> HeadlessViewer:
        home = self.home
        environment = quiet_environment() | {
            "VK_ICD_FILENAMES": str(_vulkan_driver()),
            "XDG_CONFIG_HOME": str(home),
            "XDG_DATA_HOME": str(home),
            "XDG_RUNTIME_DIR": str(home),
        }
        command = [_rerun(), "--headless", "--bind", "127.0.0.1", "--port", str(self._port), "--hide-welcome-screen"]
        with (home / "log").open("wb") as log:
            self._process = subprocess.Popen(command, stdout=log, stderr=log, env=environment, start_new_session=True)
        self._started = time.monotonic()
        self._wait("the viewer answers", self._connect)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()
        self._folder.cleanup()

    def kill(self) -> None:
        """Kill -9 of the viewer, frozen or not."""
        assert self._process is not None
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()

    def open(self, path: Path) -> None:
        """Open a recording and wait until it is loaded."""
        self.follow(str(path.resolve()))

    def follow(self, url: str) -> None:
        """Open a file or a running recorder, and wait until something is there."""
        client = self._require_client()
        logs = client.get_logs()
        self._received_at = logs[-1].sequence if logs else None
        client.open(url)

        def is_loaded() -> bool:
            state = client.get_state()
            return bool(state.active_recording and state.views and (url.startswith("rerun+") or not state.loading))

        self._wait(f"{url} is loaded", is_loaded)

    @contextmanager
    def frozen(self) -> Iterator[None]:
        """Stop the viewer's process for a while."""
        assert self._process is not None
        os.killpg(self._process.pid, signal.SIGSTOP)
        try:
            yield
        finally:
            if self._process.poll() is None:
                os.killpg(self._process.pid, signal.SIGCONT)

    def tabs(self) -> list[str]:
        """EntityPaths of the tabs of the outermost container."""
        blueprint, root = self._root()
        return [_display_name(blueprint, entry) for entry in root["contents"]]

    def show(self, tab: str) -> None:
        """Bring a tab to the front."""
        blueprint, root = self._root()
        root["active_tab"] = next(e for e in root["contents"] if _display_name(blueprint, e) == tab)
        self._require_client().set_blueprint(blueprint, of="recording")

    def go_to(self, step: int) -> None:
        """Put the cursor of the timeline ``step`` somewhere and leave it there."""
        self._require_client().set_time("step", sequence=step, play_state="paused")

    def last_step(self) -> int:
        """The last step of the recording."""
        recordings = self._require_client().get_state().recordings
        return max(int(line.end or 0) for r in recordings for line in r.timelines if line.name == "step")

    def picture(self, path: Path, *, settled: bool = True) -> None:
        """Save what is seen once the viewer's greetings are gone; ``settled``: once nothing moves any more."""
        time.sleep(max(GLIDE_S, self._started + TOASTS_S - time.monotonic()))
        self._save(path)
        end, before = time.monotonic() + SLOWEST_S, b""
        while settled and path.read_bytes() != before and time.monotonic() < end:
            before = path.read_bytes()
            time.sleep(GLIDE_S)
            self._save(path)

    def _save(self, path: Path) -> None:
        def saved() -> bool:
            try:
                self._require_client().save_screenshot(str(path))
            except TimeoutError:  # its own patience is short on a busy machine
                return False
            return True

        self._wait("a picture is taken", saved)

    def complaints(self) -> list[str]:
        """Reports of the views and warnings of the viewer since the recording was opened."""
        client = self._require_client()
        reports = [
            f"view {view.name}: {report.severity}: {report.summary} {report.details or ''}"
            for view in client.get_state().views
            for report in view.reports
        ]
        warnings = [
            f"{entry.level} {entry.target}: {entry.message}"
            for entry in client.get_logs(self._received_at)
            if entry.level in ("WARN", "ERROR") and not entry.message.startswith(HARMLESS)
        ]
        return reports + warnings

    def _connect(self) -> bool:
        assert self._process is not None
        if self._process.poll() is not None:
            raise RuntimeError(f"the viewer ended: {self._log()}")
        try:
            with socket.create_connection(("127.0.0.1", self._port), timeout=1.0):
                pass
            self._client = ViewerClient.connect(f"rerun+http://127.0.0.1:{self._port}/proxy")
            self._client.get_state()
        except (OSError, RuntimeError, ConnectionError):
            return False
        return True

    def _wait(self, what: str, happened: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE_S
        while not happened():
            if time.monotonic() > end:
                raise TimeoutError(f"waited {PATIENCE_S:g} s until {what}: {self._log()}")
            time.sleep(0.1)

    def _root(self) -> tuple[dict[str, Any], dict[str, Any]]:
        blueprint = self._require_client().get_blueprint().blueprint
        root = blueprint["/viewport"]["ViewportBlueprint"]["root_container"]
        return blueprint, blueprint[f"/container/{root}"]["ContainerBlueprint"]

    def _require_client(self) -> ViewerClient:
        if self._client is None:
            raise RuntimeError("the viewer runs only inside its with block")
        return self._client

    def _log(self) -> str:
        return (Path(self._folder.name) / "log").read_text(errors="replace")[-2000:]


def _display_name(blueprint: dict[str, Any], entry: str) -> str:
    kind = "ContainerBlueprint" if entry.startswith("container/") else "ViewBlueprint"
    return str(blueprint[f"/{entry}"][kind].get("display_name", ""))


def _vulkan_driver() -> Path | None:
    return next((icd for folder in VULKAN_DRIVERS for icd in sorted(Path(folder).glob("lvp_icd.*.json"))), None)


def _rerun() -> str:
    return str(Path(sys.executable).with_name("rerun"))


def free_port() -> int:
    """A port of the loopback on which nobody listens now."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])

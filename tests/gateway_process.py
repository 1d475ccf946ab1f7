"""A gateway as a process, and what its streams tell."""

from __future__ import annotations

import http.client
import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from ports import free_port
from waiting import until

ROOT = Path(__file__).resolve().parent.parent
READY_S = 60.0


class Gateway:
    """``lsu-mesh gateway`` on a free port of the loopback; a context manager."""

    def __init__(self, folder: Path, arguments: Sequence[str], port: int = 0) -> None:
        self.port = port or free_port()
        self.words = ""
        self._folder, self._arguments = folder, arguments

    @property
    def url(self) -> str:
        """Of the page."""
        return f"http://127.0.0.1:{self.port}/"

    def __enter__(self) -> Self:
        command = [sys.executable, "-P", "-m", "lsu_mesh_services", "gateway", "--http", f"127.0.0.1:{self.port}"]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "services")])}
        self.process = subprocess.Popen(
            [*command, *self._arguments], cwd=self._folder, env=environment, text=True, stderr=subprocess.PIPE
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        until(lambda: " at http://" in self.words or self.process.poll() is not None, "the gateway serves", READY_S)
        assert self.process.poll() is None, self.words
        until(self._answers, "the gateway answers", READY_S)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.process.kill()
        self.process.wait()
        self._reader.join(timeout=10)
        assert self.process.stderr is not None
        self.process.stderr.close()

    def stop(self, timeout: float = 15.0) -> int:
        """End it as a person would; returns the exit code."""
        self.process.terminate()
        return self.process.wait(timeout)

    def _read(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.words += line

    def _answers(self) -> bool:
        try:
            return self.ask("GET", "/model")[0] == 200
        except OSError:
            return False

    def ask(self, method: str, path: str, body: Any = None, **headers: str) -> tuple[int, Any]:
        """Status and JSON of one request."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        try:
            connection.request(method, path, None if body is None else json.dumps(body), headers)
            answer = connection.getresponse()
            text = answer.read().decode()
            return answer.status, json.loads(text) if "json" in (answer.getheader("content-type") or "") else text
        finally:
            connection.close()

    def health(self) -> dict[str, Any]:
        """Of the mesh."""
        found: dict[str, Any] = self.ask("GET", "/health")[1]
        return found

    def levels(self) -> dict[str, str]:
        """Level of each peer."""
        return {peer["name"]: peer["level"] for peer in self.health()["peers"]}

    @contextmanager
    def stream(self, path: str, **headers: str) -> Iterator[Iterator[tuple[str, str, Any]]]:
        """Kind, id and JSON of each event of a stream."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        assert answer.status == 200, answer.read()
        try:
            yield _events(answer)
        finally:
            connection.close()


def _events(lines: http.client.HTTPResponse) -> Iterator[tuple[str, str, Any]]:
    fields: dict[str, str] = {}
    for raw in lines:
        line = raw.decode().rstrip("\n")
        if line:
            name, _, value = line.partition(": ")
            fields[name] = value
        elif "data" in fields:
            yield fields.get("event", "message"), fields.get("id", ""), json.loads(fields["data"])
            fields = {}
        else:
            fields = {}

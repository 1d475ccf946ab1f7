"""``lsu-mesh simulate`` tells what it has found so far when it is asked to end."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from pathlib import Path

import psutil
import pytest


@pytest.mark.parametrize(
    ("number", "workers"),
    [
        (signal.SIGTERM, "2"),
        (signal.SIGINT, "1"),
        pytest.param(signal.SIGTERM, "1", marks=pytest.mark.soak),
        pytest.param(signal.SIGINT, "2", marks=pytest.mark.soak),
    ],
)
def test_one_that_is_asked_to_end_sums_up_the_seeds_so_far(
    lsu_mesh_command: list[str], root: Path, number: int, workers: str
) -> None:
    command = [*lsu_mesh_command, "simulate", "--seeds", "100000", "--steps", "5", "--workers", workers, "--json"]
    with subprocess.Popen(
        command, cwd=root, env={**os.environ, "PYTHONPATH": str(root)}, text=True, stdout=-1, stderr=-1
    ) as process:
        own = psutil.Process(process.pid)
        while own.cpu_times().user + sum(child.cpu_times().user for child in own.children()) < 3.0:
            assert process.poll() is None
        children = own.children(recursive=True)
        process.send_signal(number)
        out, words = process.communicate(timeout=60)
    assert process.returncode == 0, words
    (line,) = [json.loads(line) for line in out.splitlines()]
    assert line["type"] == "sum"
    assert 0 < line["seeds"] < 100000
    assert "stopped; the seeds so far" in words
    _, left = psutil.wait_procs(children, timeout=10)
    assert left == []

"""``lsu-mesh simulate`` tells what it has found so far when it is asked to end."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import psutil
import pytest

SOME_SEEDS = "12"
"""More than the processes take at once."""


def processor_time(begin: Callable[[], subprocess.Popen[str]]) -> float:
    """What a whole run of a few seeds takes here, s: start-up included, and kernels that were not compiled yet."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    with begin() as process:
        _, words = process.communicate(timeout=500)
    assert process.returncode == 0, words
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


@pytest.mark.timeout(600)
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
    command = [*lsu_mesh_command, "simulate", "--steps", "5", "--workers", workers, "--json", "--seeds"]
    paths = os.pathsep.join((str(root), str(root / "services")))
    run = partial(subprocess.Popen, cwd=root, env={**os.environ, "PYTHONPATH": paths}, text=True, stdout=-1, stderr=-1)
    enough = 2.0 * processor_time(partial(run, [*command, SOME_SEEDS]))
    with run([*command, "100000"]) as process:
        own = psutil.Process(process.pid)
        while own.cpu_times().user + sum(child.cpu_times().user for child in own.children()) < enough:
            assert process.poll() is None
            time.sleep(0.02)
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

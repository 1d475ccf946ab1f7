"""Processes that end too early are told of with their last words, and none outlives the group."""

from __future__ import annotations

import os
import time
from pathlib import Path

import psutil
import pytest
from lsu_mesh_services.benchmarks.process_group import DidNotRun, ProcessGroup
from lsu_mesh_services.benchmarks.process_usage import processor_seconds, resident_mib


def await_end(group: ProcessGroup) -> None:
    end = time.monotonic() + 20
    while time.monotonic() < end:
        group.check()
        time.sleep(0.02)


def test_a_process_that_ends_is_told_of_with_its_last_words() -> None:
    with ProcessGroup() as group:
        group.start("filter x", ["-c", "print('no such filter'); raise SystemExit(3)"])
        with pytest.raises(DidNotRun, match=r"filter x ended with exit code 3\n    no such filter"):
            await_end(group)


def test_no_process_outlives_the_group() -> None:
    with ProcessGroup() as group:
        group.start("held", ["-c", "input(); print('told'); raise SystemExit(4)"], held=True)
        group.start("other", ["-c", "import time; time.sleep(100)"])
        pids = group.pids
        group.tell("held", "now")
        with pytest.raises(DidNotRun, match=r"held ended with exit code 4\n    told"):
            await_end(group)
    assert not any(psutil.pid_exists(pid) for pid in pids.values())


def test_a_process_that_waits_for_its_line_is_told_that_none_comes(tmp_path: Path) -> None:
    mark, ready = tmp_path / "mark", tmp_path / "ready"
    program = (
        "import pathlib, signal, sys; signal.signal(15, lambda *a: None); "
        f"pathlib.Path({str(ready)!r}).touch(); sys.stdin.readline() or pathlib.Path({str(mark)!r}).touch()"
    )
    with ProcessGroup() as group:
        group.start("waits", ["-c", program], held=True)
        while not ready.exists():
            group.check()
            time.sleep(0.01)
    assert mark.exists()


def test_usage_is_that_of_another_program_that_reads_it() -> None:
    sum(k * k for k in range(3_000_000))
    pid, seen = os.getpid(), psutil.Process()
    times = seen.cpu_times()
    assert processor_seconds([pid, 2**30]) == pytest.approx(times.user + times.system, abs=0.1)
    assert resident_mib(pid) == pytest.approx(seen.memory_info().rss / 2**20, rel=0.05)
    assert resident_mib(2**30) is None

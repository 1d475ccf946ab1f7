"""What a new process costs: the import, and the first compiled step with a warm cache."""

from __future__ import annotations

import json
import resource
import statistics
import subprocess
import sys
import time
from typing import Any, NamedTuple

FORBIDDEN = ("zenoh", "rerun", "msgspec")
IMPORT = "import sys, json, lsu_mesh; print(json.dumps([name for name in {!r} if name in sys.modules]))"
FIRST_STEP = """
from lsu_mesh import {kind}
from lsu_mesh.systems import get
from lsu_mesh.supports.orthotope import Orthotope
engine = {kind}(get("P3"), Orthotope([-1.0] * 3, [1.0] * 3))
engine.update([0.1, 0.2])
engine.bounds()
engine.predict([0.3])
print('true')
"""


class FirstStep(NamedTuple):
    """Median seconds of a new process from its start to its end, one step in it: by the wall clock, and of a processor.

    On a machine that does other things too the processor's are what an idle one would show by the clock.
    """

    kind: str
    wall: float
    processor: float


def modules_of_import() -> list[str]:
    """Those of zenoh, rerun and msgspec that ``import lsu_mesh`` loads in a new process."""
    loaded: list[str] = _python(IMPORT.format(FORBIDDEN))
    return loaded


def first_step(kind: str, repeats: int) -> FirstStep:
    """A step of the filter on P3 in new processes; a first one, which warms the cache, is not counted."""
    program = FIRST_STEP.format(kind=kind)
    _python(program)
    wall, processor = [], []
    for _ in range(repeats):
        began, spent = time.perf_counter(), _children_seconds()
        _python(program)
        wall.append(time.perf_counter() - began)
        processor.append(_children_seconds() - spent)
    return FirstStep(kind, statistics.median(wall), statistics.median(processor))


def _children_seconds() -> float:
    """Processor time of all child processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _python(program: str) -> Any:
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)

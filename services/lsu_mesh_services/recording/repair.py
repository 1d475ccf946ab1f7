"""Repairing, joining and compacting recordings, on top of ``rerun rrd optimize``.

A recorder that was killed in the middle of a write, or a full disk, leaves a message cut short; viewer and reader
refuse such a file. A repaired file holds every whole message. A compacted one takes half of the space and opens faster.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

MAGIC = b"RRF2"


def repair(sources: Sequence[Path], target: Path) -> None:
    """Join recordings, whole or cut short, into one compact file, which appears only when it is complete.

    ``target`` may be one of the sources. Parts become one recording where each later one ``continues`` the first.
    Raises ``OSError`` where a file cannot be read or written, ``ValueError`` where a source is no recording.
    """
    for source in sources:
        _check(source)
    with tempfile.TemporaryDirectory(prefix=".repair-", dir=target.parent) as folder:
        made = Path(folder) / "made.rrd"
        command = [str(Path(sys.executable).with_name("rerun")), "rrd", "optimize", *map(str, sources), "-o", str(made)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=quiet_environment())
        if done.returncode != 0 or not made.is_file():
            raise ValueError(f"{', '.join(map(str, sources))}: cannot be repaired: {done.stderr.strip()[-500:]}")
        os.replace(made, target)


def quiet_environment() -> dict[str, str]:
    """The environment for Rerun's programs: no analytics, for which ``CI`` is the only variable that they heed."""
    return os.environ | {"CI": "1"}


def _check(source: Path) -> None:
    with source.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise ValueError(f"{source}: not a Rerun recording")

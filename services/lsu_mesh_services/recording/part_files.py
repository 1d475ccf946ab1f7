"""The files of one recording: ``NAME.rrd``, and its later parts ``NAME.part2.rrd``, ``NAME.part3.rrd``, …"""

from __future__ import annotations

import re
from pathlib import Path


def parts(path: Path) -> tuple[Path, ...]:
    """The file and the parts that a restarted recorder wrote beside it, in their order."""
    pattern = re.compile(re.escape(path.stem) + r"\.part(\d+)" + re.escape(path.suffix))
    beside = path.parent.iterdir() if path.parent.is_dir() else ()
    found = {int(match[1]): file for file in beside if (match := pattern.fullmatch(file.name))}
    return (path, *(found[number] for number in sorted(found)))


def next_part(path: Path) -> Path:
    """``path`` where it is free, else the first free one of ``NAME.part2.rrd``, ``NAME.part3.rrd``, …"""
    part, number = path, 1
    while part.exists():
        number += 1
        part = path.with_name(f"{path.stem}.part{number}{path.suffix}")
    return part

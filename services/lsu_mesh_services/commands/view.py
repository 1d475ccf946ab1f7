"""``lsu-mesh view FILE``: open a recording in the native Rerun viewer."""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

from lsu_mesh_services.exit_codes import COULD_NOT_START, USAGE
from lsu_mesh_services.extras import RECORD
from lsu_mesh_services.recording.part_files import parts
from lsu_mesh_services.recording.rerun_programs import quiet_environment

MAGIC = (b"RRF2", b"RRF0", b"RRIO")


def main(options: argparse.Namespace) -> int:
    path = Path(options.file)
    try:
        with path.open("rb") as file:
            magic = file.read(4)
    except OSError as error:
        print(f"{path}: cannot be read: {error.strerror}", file=sys.stderr)
        return USAGE
    if magic not in MAGIC:
        print(f"{path}: not a Rerun recording", file=sys.stderr)
        return USAGE
    viewer = Path(sys.executable).parent / "rerun"
    try:
        return subprocess.call([str(viewer), *map(str, parts(path))], env=quiet_environment())
    except FileNotFoundError:
        print(f"{viewer} is missing: {RECORD.remedy}", file=sys.stderr)
        return COULD_NOT_START

"""``lsu-mesh validate FILE``: check a configuration and start nothing."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lsu_mesh.mesh.config import Configuration, ConfigurationError, load
from lsu_mesh.mesh.config.measurement_files import PlayedFileError, accounts
from lsu_mesh.mesh.config.step_noise import noise_of_one_dt
from lsu_mesh_services.configuration import print_problems
from lsu_mesh_services.exit_codes import OK, USAGE
from lsu_mesh_services.network.security import missing_files
from lsu_mesh_services.played_files import as_records, explained, warning_records


def main(options: argparse.Namespace) -> int:
    try:
        configuration = load(Path(options.file), options.overrides, os.environ)
    except ConfigurationError as error:
        if options.json:
            _print_lines([record.as_record() for record in error.records])
        else:
            print_problems(error)
        return USAGE
    try:
        played = accounts(configuration)
    except PlayedFileError as error:
        if options.json:
            _print_lines([record.as_record() for record in error.records])
        else:
            print(explained(error), file=sys.stderr)
        return USAGE
    warnings = [*configuration.warnings, *missing_files(configuration)]
    doubts = warning_records(played)
    if options.json:
        summary = _summary(configuration, len(warnings) + len(doubts)) | {"files": as_records(played)}
        noises = [noise.as_record() for noise in noise_of_one_dt(configuration)]
        summary |= {"noise_of_one_dt": noises} if noises else {}
        _print_lines([*(warning.as_record() for warning in (*warnings, *doubts)), summary])
        return OK
    peers = [f"{role} {name}" for role, name in configuration.peers()]
    fine = f"{options.file}: fine; mesh {configuration.mesh.name!r} with {len(peers)} peers: {', '.join(peers)}"
    lines = [*(noise.line() for noise in noise_of_one_dt(configuration))]
    lines += [line for one in played.values() for line in one.lines()]
    print(*warnings, *doubts, *lines, fine, sep="\n", file=sys.stderr)
    return OK


def _summary(configuration: Configuration, warnings: int) -> dict[str, Any]:
    """The line of a file that is fine: names and counts."""
    counts = Counter(role for role, _ in configuration.peers())
    return {
        "level": "fine",
        "file": str(configuration.path),
        "mesh": configuration.mesh.name,
        "states": configuration.base_model.state_count,
        "peers": dict(sorted(counts.items())),
        "mistakes": 0,
        "warnings": warnings,
    }


def _print_lines(records: Sequence[Mapping[str, Any]]) -> None:
    for record in records:
        print(json.dumps(record))

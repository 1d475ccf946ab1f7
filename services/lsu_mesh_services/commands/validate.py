"""``lsu-mesh validate FILE``: check a configuration and start nothing."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

from lsu_mesh.mesh.config import ConfigurationError, load
from lsu_mesh.mesh.config.measurement_files import accounts
from lsu_mesh.mesh.data_files import DataFileError
from lsu_mesh_services.configuration import print_problems, print_warnings
from lsu_mesh_services.exit_codes import OK, USAGE
from lsu_mesh_services.network.security import missing_files
from lsu_mesh_services.played_files import account_warnings, as_records, explained


def main(options: argparse.Namespace) -> int:
    try:
        configuration = load(Path(options.file), options.overrides, os.environ)
    except ConfigurationError as error:
        if options.json:
            print(json.dumps({"valid": False, "problems": list(error.problems)}))
        else:
            print_problems(error)
        return USAGE
    try:
        played = accounts(configuration)
    except DataFileError as error:
        if options.json:
            print(json.dumps({"valid": False, "problems": error.lines}))
        else:
            print(explained(error), file=sys.stderr)
        return USAGE
    print_warnings(configuration)
    for warning in account_warnings(played):
        print(warning, file=sys.stderr)
    for missing in missing_files(configuration):
        print(f"{configuration.path}: warning: {missing}", file=sys.stderr)
    peers = [f"{role} {name}" for role, name in configuration.peers()]
    if options.json:
        print(json.dumps({"valid": True, "mesh": configuration.mesh.name, "peers": peers, "files": as_records(played)}))
    else:
        for account in played.values():
            print(*account.lines(), sep="\n", file=sys.stderr)
        print(
            f"{options.file}: fine; mesh {configuration.mesh.name!r} with {len(peers)} peers: {', '.join(peers)}",
            file=sys.stderr,
        )
    return OK

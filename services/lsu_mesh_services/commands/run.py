"""``lsu-mesh run``: a whole mesh as processes, with progress, a table, and the line that opens the recording."""

from __future__ import annotations

import argparse
import sys

from lsu_mesh_services.configuration import load_or_explain, print_warnings
from lsu_mesh_services.exit_codes import USAGE
from lsu_mesh_services.extras import RECORD
from lsu_mesh_services.mesh_launcher import run_mesh


def main(options: argparse.Namespace) -> int:
    configuration = load_or_explain(options.file, options, makes_filters=False)
    if configuration is None:
        return USAGE
    if options.no_record and (options.view or options.web is not None):
        print("run: viewers follow the recorder; leave out --no-record", file=sys.stderr)
        return USAGE
    print_warnings(configuration)
    if not options.no_record and (missing := RECORD.missing()):
        print(f"run: nothing is recorded: {', '.join(missing)} not installed: {RECORD.remedy}", file=sys.stderr)
        options.no_record = True
    return run_mesh(configuration, options)

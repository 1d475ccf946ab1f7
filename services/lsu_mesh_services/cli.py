"""``lsu-mesh``: the command line. Imports of a command happen when it runs, so that ``--help`` is immediate."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn

from lsu_mesh_services.exit_codes import COULD_NOT_START, FAILURE
from lsu_mesh_services.extras import refusal
from lsu_mesh_services.options import (
    bench,
    bridge,
    doctor,
    gateway,
    graph,
    health,
    identify,
    import_bag,
    keys,
    new,
    peer,
    publish,
    recording,
    replay,
    reproduce,
    run,
    simulate,
    validate,
    view,
    watch,
)
from lsu_mesh_services.options.parsing import EXIT_CODES
from lsu_mesh_services.stop import Stop, leave

GROUPS = (
    run,
    peer,
    publish,
    new,
    import_bag,
    validate,
    doctor,
    graph,
    watch,
    health,
    gateway,
    keys,
    view,
    replay,
    recording,
    bridge,
    simulate,
    identify,
    reproduce,
    bench,
)
"""In the order of ``lsu-mesh --help``."""


def build_parser() -> argparse.ArgumentParser:
    """The whole command surface."""
    parser = argparse.ArgumentParser(
        prog="lsu-mesh",
        description="Guaranteed state estimation with bounded noise, as a mesh of peers over Zenoh.",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=_version())
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for group in GROUPS:
        group.add(commands)
    return parser


def _version() -> str:
    from lsu_mesh import __version__

    return f"lsu-mesh {__version__}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    import importlib

    options = build_parser().parse_args(arguments)
    if words := refusal(options):
        print(words, file=sys.stderr)
        return COULD_NOT_START
    if getattr(options, "runs_until_stopped", False):
        options.stop = Stop()  # before the imports of the command, which take a while
    handler: Callable[[argparse.Namespace], int] = importlib.import_module(options.handler).main
    try:
        return handler(options)
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        sys.stderr.close()
        return FAILURE


def entry() -> NoReturn:
    """Entry point of ``lsu-mesh``."""
    os.environ["PYTHONSAFEPATH"] = "1"  # no child, a worker of a pool neither, imports what lies in the working folder
    leave(main())


if __name__ == "__main__":
    entry()

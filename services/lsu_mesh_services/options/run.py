"""Options of ``lsu-mesh run``."""

from __future__ import annotations

import argparse

from lsu_mesh_services.extras import MESH, RECORD, Extra
from lsu_mesh_services.options.parsing import Commands, add_insecure, add_overrides, new_command


def add(commands: Commands) -> None:
    """The command ``run``."""
    parser = new_command(commands, "run", "start a whole mesh as processes, record it, and print a summary")
    parser.add_argument("file", nargs="?", metavar="mesh.toml", help="configuration (default: the packaged demo)")
    parser.add_argument("--steps", type=int, metavar="N", help="stop after step N (mesh.steps)")
    parser.add_argument("--rate", type=float, metavar="HZ", help="steps per second of wall clock (default: 1/dt)")
    parser.add_argument("--seed", type=int, metavar="S", help="seed of the simulation (mesh.seed)")
    parser.add_argument("--record", metavar="FILE", help="recording to write (default: recorder.path)")
    parser.add_argument("--no-record", action="store_true", help="start no recorder")
    parser.add_argument(
        "--view", action="store_true", help="show the run in the native viewer, which may freeze or be closed"
    )
    parser.add_argument(
        "--web", nargs="?", type=int, const=9090, metavar="PORT",
        help="serve the web viewer on this port of the loopback interface (default: 9090)",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="JSON lines on stdout instead of a table")
    add_insecure(parser)
    add_overrides(parser)
    parser.set_defaults(handler="lsu_mesh_services.commands.run", extra=_extra, runs_until_stopped=True)


def _extra(options: argparse.Namespace) -> Extra:
    """A recording, and a viewer, which follows it, need more than the mesh does."""
    wants_recording = options.record is not None or options.view or options.web is not None
    return RECORD if wants_recording else MESH

"""Options of ``lsu-mesh view``."""

from __future__ import annotations

from lsu_mesh_services.extras import RECORD
from lsu_mesh_services.options.parsing import Commands, new_command


def add(commands: Commands) -> None:
    """The command ``view``."""
    parser = new_command(commands, "view", "open a recording in the Rerun viewer")
    parser.add_argument("file", metavar="FILE.rrd", help="recording to open")
    parser.set_defaults(handler="lsu_mesh_services.commands.view", extra=RECORD)

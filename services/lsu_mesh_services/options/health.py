"""Options of ``lsu-mesh health``."""

from __future__ import annotations

from lsu_mesh_services.extras import MESH
from lsu_mesh_services.options.parsing import Commands, add_network, add_overrides, new_command


def add(commands: Commands) -> None:
    """The command ``health``."""
    parser = new_command(
        commands,
        "health",
        "print the level of each peer of a running mesh, with reasons; the exit code follows the worst level",
    )
    parser.add_argument("-c", "--config", metavar="mesh.toml", help="configuration (default: the packaged demo)")
    parser.add_argument("--seconds", type=float, default=3.5, metavar="S", help="how long to listen (default: 3.5)")
    parser.add_argument("--json", action="store_true", help="JSON lines on stdout: one per peer")
    add_overrides(parser)
    add_network(parser)
    parser.set_defaults(handler="lsu_mesh_services.commands.health", extra=MESH)

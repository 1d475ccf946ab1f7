"""Options of ``lsu-mesh keys``."""

from __future__ import annotations

from lsu_mesh_services.extras import MESH
from lsu_mesh_services.options.parsing import Commands, add_overrides, new_command


def add(commands: Commands) -> None:
    """The command ``keys``."""
    parser = new_command(commands, "keys", "make a certificate authority and a certificate for each peer (labs, tests)")
    parser.add_argument("what", choices=("init",), help="init: make the files that do not exist yet")
    parser.add_argument("file", metavar="mesh.toml", help="configuration; [network.tls] names the files")
    parser.add_argument(
        "--host", metavar="NAME", action="append", default=[],
        help="host name or address of the peers, besides those of the loopback; may be repeated",
    )  # fmt: skip
    parser.add_argument("--days", type=int, default=365, metavar="N", help="days of validity (default: 365)")
    add_overrides(parser)
    parser.set_defaults(handler="lsu_mesh_services.commands.keys", extra=MESH)

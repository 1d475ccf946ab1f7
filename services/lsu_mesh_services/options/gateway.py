"""Options of ``lsu-mesh gateway``."""

from __future__ import annotations

from lsu_mesh_services.extras import GATEWAY
from lsu_mesh_services.options.parsing import Commands, add_network, add_overrides, new_command


def add(commands: Commands) -> None:
    """The command ``gateway``."""
    parser = new_command(commands, "gateway", "serve the mesh over HTTP: a page with live bands, streams, metrics")
    parser.epilog = f"example:\n  lsu-mesh gateway -c mesh.toml --http 127.0.0.1:8080\n\n{parser.epilog}"
    parser.add_argument("-c", "--config", metavar="mesh.toml", help="configuration (default: the packaged demo)")
    group = parser.add_argument_group("http")
    group.add_argument(
        "--http", metavar="HOST:PORT", default="127.0.0.1:8080",
        help="where to listen (default: 127.0.0.1:8080); port 0 is a free one",
    )  # fmt: skip
    group.add_argument(
        "--allow-remote", action="store_true",
        help="allow --http to listen for other hosts: whoever reaches it reads the mesh",
    )  # fmt: skip
    group.add_argument(
        "--host", metavar="NAME", action="append", default=[],
        help="a further name by which browsers may call the gateway; may be repeated",
    )  # fmt: skip
    group.add_argument(
        "--token-file", metavar="FILE",
        help="token that allows to publish external sensors; made where it is missing (default: mesh.gateway-token "
        "beside mesh.toml)",
    )  # fmt: skip
    add_overrides(parser)
    add_network(parser)
    parser.set_defaults(handler="lsu_mesh_services.commands.gateway", extra=GATEWAY, runs_until_stopped=True)

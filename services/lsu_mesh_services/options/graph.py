"""Options of ``lsu-mesh graph``."""

from __future__ import annotations

from lsu_mesh_services.extras import MESH
from lsu_mesh_services.options.parsing import Commands, add_network, add_overrides, new_command


def add(commands: Commands) -> None:
    """The command ``graph``."""
    parser = new_command(commands, "graph", "show who publishes what to whom")
    parser.epilog = f"example:\n  lsu-mesh graph mesh.toml --dot | dot -Tsvg > mesh.svg\n\n{parser.epilog}"
    parser.add_argument("config", nargs="?", metavar="mesh.toml", help="configuration (default: the packaged demo)")
    parser.add_argument("--live", action="store_true", help="ask the running mesh which peers are there")
    shape = parser.add_mutually_exclusive_group()
    shape.add_argument("--dot", action="store_true", help="for Graphviz")
    shape.add_argument("--mermaid", action="store_true", help="for Mermaid, as in Markdown pages")
    shape.add_argument("--json", action="store_true", help="JSON lines on stdout: one per peer and one per key")
    add_overrides(parser)
    add_network(parser)
    parser.set_defaults(
        handler="lsu_mesh_services.commands.graph", extra=lambda options: MESH if options.live else None
    )

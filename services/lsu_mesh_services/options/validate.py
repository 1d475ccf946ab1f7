"""Options of ``lsu-mesh validate``."""

from __future__ import annotations

from lsu_mesh_services.options.parsing import Commands, add_overrides, new_command


def add(commands: Commands) -> None:
    """The command ``validate``."""
    parser = new_command(commands, "validate", "check a configuration and its files; start nothing")
    parser.add_argument("file", metavar="mesh.toml", help="configuration to check")
    parser.add_argument("--json", action="store_true", help="JSON lines on stdout: one per mistake and warning")
    add_overrides(parser)
    parser.set_defaults(handler="lsu_mesh_services.commands.validate", extra=None)

"""Options of ``lsu-mesh doctor``."""

from __future__ import annotations

from lsu_mesh_services.options.parsing import Commands, add_overrides, new_command


def add(commands: Commands) -> None:
    """The command ``doctor``."""
    parser = new_command(commands, "doctor", "check whether this machine can run the mesh, and name the remedy if not")
    parser.epilog = f"example:\n  lsu-mesh doctor mesh.toml\n\n{parser.epilog}"
    parser.add_argument("config", nargs="?", metavar="mesh.toml", help="configuration (default: the packaged demo)")
    parser.add_argument("--json", action="store_true", help="JSON lines on stdout: one per check")
    add_overrides(parser)
    parser.set_defaults(handler="lsu_mesh_services.commands.doctor", extra=None)

"""Arguments of ``lsu-mesh new``."""

from __future__ import annotations

from lsu_mesh_services.options.parsing import Commands, new_command


def add(commands: Commands) -> None:
    """The command ``new``."""
    parser = new_command(commands, "new", "write a commented configuration to start from")
    parser.epilog = f"example:\n  lsu-mesh new mesh.toml --from file drive.csv\n\n{parser.epilog}"
    parser.add_argument("file", metavar="mesh.toml", help="configuration to write")
    parser.add_argument(
        "--from", dest="source", nargs="+", default=["demo"], metavar="WHAT",
        help="demo: the packaged demo, or file DATA.csv: a mesh that plays these measurements (default: demo)",
    )  # fmt: skip
    index = parser.add_mutually_exclusive_group()
    index.add_argument("--time", metavar="COLUMN", help="column of times of the data (default: found by its name)")
    index.add_argument("--step", metavar="COLUMN", help="column of steps of the data")
    parser.add_argument(
        "--columns", metavar="A,B", help="columns of values of the data (default: all that hold numbers)"
    )
    parser.add_argument("--force", action="store_true", help="write over a file that is there")
    parser.set_defaults(handler="lsu_mesh_services.commands.new", extra=None)

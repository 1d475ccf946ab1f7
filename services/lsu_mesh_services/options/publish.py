"""Options of ``lsu-mesh publish``."""

from __future__ import annotations

from lsu_mesh_services.extras import MESH
from lsu_mesh_services.options.parsing import Commands, add_network, add_overrides, new_command

FORMATS = """lines of standard input, one measurement each:
  1.5                                  a number, of a sensor with one output; it was measured now
  [1.5, null]                          a list, one value per output; null was not measured
  {"time": 1700000000.25, "y": [1.5]}  with its time: seconds since 1970, a date with its zone, or "now";
                                       time_ns and time_error (seconds) are known too
  {"time": "now", "height": 1.5}       by the names of the outputs
  time,height                          or CSV: a header, which names columns, and then rows

example:
  awk '{ print $2; fflush() }' /dev/ttyUSB0 | lsu-mesh publish gauge -c mesh.toml
"""


def add(commands: Commands) -> None:
    """The command ``publish``."""
    parser = new_command(commands, "publish", "be a sensor: send each line of standard input as a measurement")
    parser.epilog = f"{FORMATS}\n{parser.epilog}"
    parser.add_argument("name", metavar="NAME", help='name of a sensor with source = "external", or of the plant')
    parser.add_argument("-c", "--config", metavar="mesh.toml", help="configuration (default: the packaged demo)")
    parser.add_argument("--plant", action="store_true", help="NAME is the plant, and each line holds its inputs")
    add_overrides(parser)
    add_network(parser)
    parser.set_defaults(handler="lsu_mesh_services.commands.publish", extra=MESH)

"""Options of ``lsu-mesh identify``."""

from __future__ import annotations

from lsu_mesh_services.extras import RECORD
from lsu_mesh_services.options.parsing import Commands, add_overrides, new_command

LEARN = ("both", "r", "rho", "separate")


def add(commands: Commands) -> None:
    """The command ``identify``."""
    parser = new_command(commands, "identify", "find noise bounds, and parameters, that explain recorded data")
    parser.add_argument("file", metavar="mesh.toml", help="configuration: its model, and sensors that play files")
    parser.add_argument("--recording", metavar="FILE.rrd", help="take measurements and inputs from a recording instead")
    parser.add_argument(
        "--sensors", metavar="NAME", nargs="+", help="sensors to use (default: all that have data)"
    )  # fmt: skip
    parser.add_argument(
        "--learn", choices=LEARN, default="both",
        help="which half-widths grow: both, r or rho by one factor, or each by itself (default: both)",
    )  # fmt: skip
    parser.add_argument(
        "--unknown", metavar="M,I,J,LOW,HIGH", action="append", default=[],
        help="an unknown entry of A, B or C, such as A,1,2,-1,1; may be given several times",
    )  # fmt: skip
    parser.add_argument(
        "--margin", type=float, default=1.2, metavar="X", help="multiplies the smallest half-widths (default: 1.2)"
    )  # fmt: skip
    parser.add_argument(
        "--share", type=float, default=0.5, metavar="X",
        help="share of the data that is used; the bounds are tried on the rest (default: 0.5)",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="one JSON line on stdout instead of text")
    add_overrides(parser)
    parser.set_defaults(
        handler="lsu_mesh_services.commands.identify", extra=lambda options: RECORD if options.recording else None
    )

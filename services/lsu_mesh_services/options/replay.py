"""Options of ``lsu-mesh replay``."""

from __future__ import annotations

from lsu_mesh_services.extras import RECORD
from lsu_mesh_services.options.parsing import Commands, new_command


def add(commands: Commands) -> None:
    """The command ``replay``."""
    parser = new_command(
        commands, "replay", "run a recording again: recompute it, prove it, or put other filters to its data"
    )
    parser.add_argument("file", metavar="FILE.rrd", help="recording; parts of a restarted recorder are found beside it")
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--verify", action="store_true",
        help="recompute every published set from its provenance, compare it bit by bit, check that it holds the truth",
    )  # fmt: skip
    what.add_argument(
        "--live", action="store_true", help="run filters and fusions as peers over Zenoh, at the recorded rate"
    )
    parser.add_argument("--with", dest="other", metavar="other.toml", help="filters and fusions of another mesh")
    parser.add_argument(
        "--record", metavar="OUT.rrd", help="write a recording of the replay; with --with it shows both"
    )
    parser.add_argument("--json", action="store_true", help="JSON lines on stdout instead of a table")
    parser.add_argument(
        "-X", dest="overrides", metavar="TABLE.KEY=VALUE", action="append", default=[],
        help="set any key of the configuration that is replayed, such as -X filters.cz.max_generators=30",
    )  # fmt: skip
    parser.set_defaults(handler="lsu_mesh_services.commands.replay", extra=RECORD)

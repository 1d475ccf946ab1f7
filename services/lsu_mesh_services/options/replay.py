"""Options of ``lsu-mesh replay``."""

from __future__ import annotations

import argparse

from lsu_mesh_services.extras import RECORD
from lsu_mesh_services.options.parsing import Commands, new_command

DEFAULT_LAG = 5
"""Steps of ``--smooth`` without a number."""


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
        "--smooth", metavar="L", nargs="?", type=_lag, const=DEFAULT_LAG,
        help="give every filter of kind LSUCZ a lag of L steps (default: 5): its sets of each step given L steps more, "
        "beside those given no more; the limits of its sets are raised by n generators and m constraints a step",
    )  # fmt: skip
    parser.add_argument(
        "--record", metavar="OUT.rrd", help="write a recording of the replay; with --with, --smooth or -X it shows both"
    )
    parser.add_argument("--json", action="store_true", help="JSON lines on stdout instead of a table")
    parser.add_argument(
        "-X", dest="overrides", metavar="TABLE.KEY=VALUE", action="append", default=[],
        help="set any key of the configuration that is replayed, such as -X filters.cz.max_generators=30",
    )  # fmt: skip
    parser.set_defaults(handler="lsu_mesh_services.commands.replay", extra=RECORD)


def _lag(text: str) -> int:
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a number of steps, 1 or more, found {text!r}; give FILE first")
    return int(text)

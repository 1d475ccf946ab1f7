"""Options of ``lsu-mesh simulate``."""

from __future__ import annotations

from lsu_mesh_services.options.parsing import Commands, new_command


def add(commands: Commands) -> None:
    """The command ``simulate``."""
    parser = new_command(
        commands, "simulate", "run the whole mesh in one process under seeded faults and check every message"
    )
    parser.add_argument("file", nargs="?", metavar="mesh.toml", help="configuration (default: the packaged demo)")
    parser.add_argument("--seeds", type=int, default=100, metavar="N", help="how many seeds (default: 100)")
    parser.add_argument("--from", dest="first", type=int, default=1, metavar="S", help="the first seed (default: 1)")
    parser.add_argument("--seed", type=int, metavar="S", help="only this seed")
    parser.add_argument("--steps", type=int, default=300, metavar="N", help="steps of each run (default: 300)")
    parser.add_argument(
        "--faults", default="all", metavar="KINDS",
        help="all, none, or some of drop,delay,duplicate,reorder,corrupt,partition,freeze,kill,skew (default: all)",
    )  # fmt: skip
    parser.add_argument("--workers", type=int, metavar="N", help="processes (default: one per processor)")
    parser.add_argument("--minutes", type=float, metavar="M", help="begin no more seeds after so many minutes")
    parser.add_argument("--json", action="store_true", help="JSON lines on stdout: one per broken seed, and the sum")
    parser.set_defaults(handler="lsu_mesh_services.commands.simulate", extra=None)

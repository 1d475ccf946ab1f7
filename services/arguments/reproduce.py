"""Arguments of ``lsu-mesh reproduce``."""

from __future__ import annotations

from services.arguments.parsing import Commands, new_command

REPRODUCIBLE = {
    "fusion": "three filters and their fusion on P3; Bayesian transfer against the source's noise",
}


def add(commands: Commands) -> None:
    """The command ``reproduce``."""
    parser = new_command(
        commands, "reproduce", "run an experiment: its tables, figures, and checks against the numbers to reach"
    )
    listed = "; ".join(f"{what}: {words}" for what, words in REPRODUCIBLE.items())
    parser.add_argument("what", metavar="WHAT", choices=tuple(REPRODUCIBLE), help=listed)
    parser.add_argument("--quick", action="store_true", help="fewer seeds and steps")
    parser.add_argument("--json", action="store_true", help="JSON lines on stdout instead of tables")
    parser.add_argument("--out", metavar="DIR", help="folder for CSV, Markdown and PNG files (default: only print)")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="first seed of the simulations (default: 1)")
    parser.set_defaults(handler="services.commands.reproduce")

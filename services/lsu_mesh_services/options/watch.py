"""Options of the commands that observe a running mesh: ``list echo hz top``."""

from __future__ import annotations

import argparse
import math

from lsu_mesh_services.extras import MESH
from lsu_mesh_services.options.parsing import Commands, add_network, add_overrides, new_command

ADDRESS = "TOPIC/NAME"
ADDRESS_HELP = "such as posterior/cz; posterior or posterior/* for all of a topic; a whole key is fine too"


def add(commands: Commands) -> None:
    """The commands ``list``, ``echo``, ``hz`` and ``top``."""
    _add_list(commands)
    _add_echo(commands)
    _add_hz(commands)
    _add_top(commands)


def _add_list(commands: Commands) -> None:
    parser = _tool(commands, "list", "list the peers and keys that are alive, with their rates", "lsu-mesh list")
    _add_seconds(parser, 2.0, "how long to listen (default: 2)")
    parser.set_defaults(handler="lsu_mesh_services.commands.listing")


def _add_echo(commands: Commands) -> None:
    example = "lsu-mesh echo posterior/cz --field upper -n 3"
    parser = _tool(commands, "echo", "print the decoded messages of a topic as they arrive", example)
    parser.add_argument("address", metavar=ADDRESS, help=ADDRESS_HELP)
    parser.add_argument("--field", metavar="FIELD", help="print only this part, such as upper, upper.0 or support.type")
    parser.add_argument("-n", "--count", type=_count, metavar="N", help="end after N messages (default: until Ctrl-C)")
    parser.add_argument(
        "--timeout", type=_seconds, metavar="S", help="end after so long without enough messages, with exit code 4"
    )
    parser.set_defaults(handler="lsu_mesh_services.commands.echo")


def _add_hz(commands: Commands) -> None:
    parser = _tool(commands, "hz", "measure rate, jitter and latency of a topic", "lsu-mesh hz fused/main --seconds 5")
    parser.add_argument("address", metavar=ADDRESS, help=ADDRESS_HELP)
    _add_seconds(parser, None, "measure so long and print once (default: a line every second, until Ctrl-C)")
    parser.set_defaults(handler="lsu_mesh_services.commands.hz")


def _add_top(commands: Commands) -> None:
    words = "watch how every peer does: level, step, rate, latency, gaps, queue, time of a step"
    parser = _tool(commands, "top", words, "lsu-mesh top --once")
    parser.add_argument(
        "--once", action="store_true", help="print one table and end; the default where stdout is no terminal"
    )
    _add_seconds(parser, 3.5, "how long --once listens (default: 3.5)")
    parser.set_defaults(handler="lsu_mesh_services.commands.top")


def _tool(commands: Commands, name: str, words: str, example: str) -> argparse.ArgumentParser:
    """What all of them take."""
    parser = new_command(commands, name, words)
    parser.epilog = f"example:\n  {example}\n\n{parser.epilog}"
    parser.add_argument("-c", "--config", metavar="mesh.toml", help="configuration (default: the packaged demo)")
    parser.add_argument("--json", action="store_true", help="JSON lines on stdout")
    add_overrides(parser)
    add_network(parser)
    parser.set_defaults(runs_until_stopped=True, extra=MESH)
    return parser


def _add_seconds(parser: argparse.ArgumentParser, default: float | None, words: str) -> None:
    parser.add_argument("--seconds", type=_seconds, default=default, metavar="S", help=words)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0 < seconds < math.inf:
        raise argparse.ArgumentTypeError(f"expected seconds above 0, found {text!r}")
    return seconds


def _count(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a count from 1, found {text!r}")
    return int(text)

"""Options that several commands share."""

from __future__ import annotations

import argparse
from typing import TypeAlias

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
EXIT_CODES = """exit codes:
  0  fine, or stopped once by Ctrl-C     3  could not start
  1  failure                             4  a check or wait was not met
  2  usage or configuration            130  second Ctrl-C"""


def new_command(commands: Commands, name: str, words: str) -> argparse.ArgumentParser:
    """A command whose description is its line in the list of commands, and whose help ends with the exit codes."""
    return commands.add_parser(
        name, help=words, description=f"{words[0].upper()}{words[1:]}.", epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip


def add_overrides(parser: argparse.ArgumentParser) -> None:
    """``-X``: any key of the configuration."""
    parser.add_argument(
        "-X", dest="overrides", metavar="TABLE.KEY=VALUE", action="append", default=[],
        help="set any key of the configuration, such as -X filters.cz.max_generators=30",
    )  # fmt: skip


def add_network(parser: argparse.ArgumentParser) -> None:
    """How the peer reaches the mesh."""
    group = parser.add_argument_group("network (Zenoh's own flags)")
    group.add_argument("-m", "--mode", choices=("peer", "client", "router"), help="kind of session (default: peer)")
    group.add_argument(
        "-e", "--connect", metavar="ENDPOINT", action="append", default=[],
        help="endpoint to connect to, such as tcp/127.0.0.1:7447 (default: network.entry of the configuration)",
    )  # fmt: skip
    group.add_argument(
        "-l", "--listen", metavar="ENDPOINT", action="append", default=[],
        help="endpoint to listen on (default: network.listen, else a free port of the loopback interface)",
    )  # fmt: skip
    add_insecure(group)
    group.add_argument("--cfg", metavar="PATH:VALUE", action="append", default=[], help="any setting of Zenoh")
    scouting = group.add_mutually_exclusive_group()
    scouting.add_argument("--multicast-scouting", action="store_true", help="find peers by multicast too")
    scouting.add_argument("--no-multicast-scouting", action="store_true", help="the default; for scripts that state it")


def add_insecure(group: argparse._ActionsContainer) -> None:
    """``--insecure``: listening for other hosts without TLS is meant."""
    group.add_argument(
        "--insecure", action="store_true",
        help="allow listening for other hosts without TLS, where the network itself is closed",
    )  # fmt: skip

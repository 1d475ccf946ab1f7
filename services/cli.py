"""``lsu-mesh``: the command line. Imports of a command happen when it runs, so that ``--help`` is immediate."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence

OK, FAILURE, USAGE, COULD_NOT_START, NOT_MET = 0, 1, 2, 3, 4
ROLES = {
    "plant": "simulate the plant: publish true states and inputs",
    "sensor": "simulate a sensor, or play its file of measurements",
    "filter": "run one filter on its sensors and publish posteriors",
    "fusion": "intersect the posteriors of all filters",
    "recorder": "write everything into a Rerun recording",
}
REPRODUCIBLE = {
    "fusion": "three filters and their fusion on P3; Bayesian transfer against the source's noise",
}
EXIT_CODES = """exit codes:
  0  fine, or stopped once by Ctrl-C     3  could not start
  1  failure                             4  a check or wait was not met
  2  usage or configuration            130  second Ctrl-C"""


def build_parser() -> argparse.ArgumentParser:
    """The whole command surface."""
    parser = argparse.ArgumentParser(
        prog="lsu-mesh",
        description="Guaranteed state estimation with bounded noise, as a mesh of peers over Zenoh.",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=_version())
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    _add_run(commands)
    for role, words in ROLES.items():
        _add_peer(commands, role, words)
    _add_router(commands)
    _add_validate(commands)
    _add_view(commands)
    _add_reproduce(commands)
    _add_bench(commands)
    return parser


def _version() -> str:
    from lsu_mesh import __version__

    return f"lsu-mesh {__version__}"


def _start_time(text: str) -> int | str:
    if text == "-":
        return text
    if not text.isdigit():
        raise argparse.ArgumentTypeError(f"expected nanoseconds since 1970, or -; found {text!r}")
    return int(text)


def _new(
    commands: argparse._SubParsersAction[argparse.ArgumentParser], name: str, words: str
) -> argparse.ArgumentParser:
    return commands.add_parser(
        name, help=words, description=f"{words[0].upper()}{words[1:]}.", epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip


def _add_overrides(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-X", dest="overrides", metavar="TABLE.KEY=VALUE", action="append", default=[],
        help="set any key of the configuration, such as -X filters.cz.max_generators=30",
    )  # fmt: skip


def _add_network(parser: argparse.ArgumentParser) -> None:
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
    group.add_argument("--cfg", metavar="PATH:VALUE", action="append", default=[], help="any setting of Zenoh")
    scouting = group.add_mutually_exclusive_group()
    scouting.add_argument("--multicast-scouting", action="store_true", help="find peers by multicast too")
    scouting.add_argument("--no-multicast-scouting", action="store_true", help="the default, for scripts that say so")


def _add_run(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = _new(commands, "run", "start a whole mesh as processes, record it, and sum it up")
    parser.add_argument("file", nargs="?", metavar="mesh.toml", help="configuration (default: the packaged demo)")
    parser.add_argument("--steps", type=int, metavar="N", help="stop after step N (mesh.steps)")
    parser.add_argument("--rate", type=float, metavar="HZ", help="steps per second of wall clock (default: 1/dt)")
    parser.add_argument("--seed", type=int, metavar="S", help="seed of the simulation (mesh.seed)")
    parser.add_argument("--record", metavar="FILE", help="recording to write (default: recorder.path)")
    parser.add_argument("--no-record", action="store_true", help="start no recorder")
    parser.add_argument("--json", action="store_true", help="JSON lines on stdout instead of a table")
    _add_overrides(parser)
    parser.set_defaults(handler="services.commands.run")


def _add_peer(commands: argparse._SubParsersAction[argparse.ArgumentParser], role: str, words: str) -> None:
    parser = _new(commands, role, words)
    named = {"plant": "plant", "recorder": "recorder"}.get(role)
    if named is None:
        parser.add_argument("name", metavar="NAME", help=f"name of the {role} in the configuration")
    else:
        parser.add_argument("name", metavar="NAME", nargs="?", default=named, help=f"name (default: {named})")
    parser.add_argument("-c", "--config", metavar="mesh.toml", help="configuration (default: the packaged demo)")
    if role in ("plant", "sensor"):
        parser.add_argument(
            "--start-at", type=_start_time, metavar="NS",
            help="nanoseconds since 1970 when step 1 is due, or - to read them from standard input (default: now)",
        )  # fmt: skip
        parser.add_argument("--rate", type=float, metavar="HZ", help="steps per second of wall clock (default: 1/dt)")
    if role == "recorder":
        parser.add_argument("--record", metavar="FILE", help="recording to write (default: recorder.path)")
    _add_overrides(parser)
    _add_network(parser)
    parser.set_defaults(handler="services.commands.peer", role=role)


def _add_router(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = _new(commands, "router", "route between peers of different networks")
    parser.add_argument("name", metavar="NAME", nargs="?", default="router", help="only shown (default: router)")
    _add_network(parser)
    parser.set_defaults(handler="services.commands.router")


def _add_validate(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = _new(commands, "validate", "check a configuration and its files; start nothing")
    parser.add_argument("file", metavar="mesh.toml", help="configuration to check")
    parser.add_argument("--json", action="store_true", help="JSON lines on stdout")
    _add_overrides(parser)
    parser.set_defaults(handler="services.commands.validate")


def _add_view(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = _new(commands, "view", "open a recording in the Rerun viewer")
    parser.add_argument("file", metavar="FILE.rrd", help="recording to open")
    parser.set_defaults(handler="services.commands.view")


def _add_reproduce(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = _new(
        commands, "reproduce", "run an experiment: its tables, figures, and checks against the numbers to reach"
    )
    listed = "; ".join(f"{what}: {words}" for what, words in REPRODUCIBLE.items())
    parser.add_argument("what", metavar="WHAT", choices=tuple(REPRODUCIBLE), help=listed)
    parser.add_argument("--quick", action="store_true", help="fewer seeds and steps")
    parser.add_argument("--json", action="store_true", help="JSON lines on stdout instead of tables")
    parser.add_argument("--out", metavar="DIR", help="folder for CSV, Markdown and PNG files (default: only print)")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="first seed of the simulations (default: 1)")
    parser.set_defaults(handler="services.commands.reproduce")


def _add_bench(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = _new(commands, "bench", "measure speed beside other libraries, as ratios in one run on one core")
    parser.add_argument("what", choices=("kernels",), help="kernels: steps of filters, hulls, banks, a new process")
    parser.add_argument("--quick", action="store_true", help="few sizes and rounds: shows that it works, not how fast")
    parser.add_argument("--out", metavar="DIR", help="folder for the figure and the JSON file (needs matplotlib)")
    parser.add_argument("--json", action="store_true", help="one JSON line on stdout instead of tables")
    parser.set_defaults(handler="services.commands.bench")


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of ``lsu-mesh``; returns the exit code."""
    import importlib

    options = build_parser().parse_args(arguments)
    handler: Callable[[argparse.Namespace], int] = importlib.import_module(options.handler).main
    try:
        return handler(options)
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        sys.stderr.close()
        return FAILURE


if __name__ == "__main__":
    sys.exit(main())

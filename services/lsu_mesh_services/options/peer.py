"""Options of the commands that run one peer: a role of the mesh, or a router."""

from __future__ import annotations

import argparse

from lsu_mesh_services.extras import MESH, RECORD
from lsu_mesh_services.options.parsing import Commands, add_network, add_overrides, new_command

ROLES = {
    "plant": "simulate the plant: publish true states and inputs",
    "sensor": "simulate a sensor, or play its file of measurements",
    "filter": "run one filter on its sensors and publish posteriors",
    "fusion": "intersect the posteriors of all filters",
    "identifier": "watch measurements and suggest noise bounds that explain them",
    "recorder": "write everything into a Rerun recording",
}


def add(commands: Commands) -> None:
    """One command for each role of the mesh, and ``router``."""
    for role, words in ROLES.items():
        _add_peer(commands, role, words)
    _add_router(commands)


def _start_time(text: str) -> int | str:
    if text == "-":
        return text
    if not text.isdigit():
        raise argparse.ArgumentTypeError(f"expected nanoseconds since 1970, or -; found {text!r}")
    return int(text)


def _add_peer(commands: Commands, role: str, words: str) -> None:
    parser = new_command(commands, role, words)
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
        parser.add_argument(
            "--serve", type=int, metavar="PORT",
            help="let viewers follow at rerun+http://127.0.0.1:PORT/proxy (default: no network)",
        )  # fmt: skip
    add_overrides(parser)
    add_network(parser)
    parser.set_defaults(
        handler="lsu_mesh_services.commands.peer",
        extra=RECORD if role == "recorder" else MESH,
        runs_until_stopped=True,
        role=role,
    )


def _add_router(commands: Commands) -> None:
    parser = new_command(commands, "router", "route between peers of different networks")
    parser.add_argument("name", metavar="NAME", nargs="?", default="router", help="only shown (default: router)")
    parser.add_argument(
        "-c", "--config", metavar="mesh.toml", help="configuration with the certificates and rules of its mesh"
    )
    add_overrides(parser)
    add_network(parser)
    parser.set_defaults(handler="lsu_mesh_services.commands.router", extra=MESH, runs_until_stopped=True)

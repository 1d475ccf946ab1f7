"""``lsu-mesh plant|sensor|filter|fusion|recorder NAME``: run one peer in this process."""

from __future__ import annotations

import argparse
import secrets
import sys
import threading
import time

from lsu_mesh.errors import LsuMeshError
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.config.problem import nearest
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.nodes.schedule import GridSchedule, Schedule
from lsu_mesh_services.configuration import load_or_explain
from lsu_mesh_services.exit_codes import COULD_NOT_START, USAGE
from lsu_mesh_services.extras import ROS2
from lsu_mesh_services.session import session_settings, with_session

ESTIMATING = ("filter", "fusion", "identifier")
"""Roles that check the options of all filters; the others load no kernel."""


def main(options: argparse.Namespace) -> int:
    makes_filters = options.role in ESTIMATING
    configuration = load_or_explain(options.config, options, makes_filters=makes_filters)
    if configuration is None:
        return USAGE
    known = [name for role, name in configuration.peers() if role == options.role]
    if options.name not in known:
        print(
            f"{configuration.path}: there is no {options.role} {options.name!r}; {nearest(options.name, known)}",
            file=sys.stderr,
        )
        return USAGE
    if configuration.is_external(options.role, options.name):
        print(
            f"{configuration.path}: {options.role} {options.name} is external: a program of yours sends what it "
            f"publishes; try: lsu-mesh publish {options.name} -c {configuration.path}",
            file=sys.stderr,
        )
        return USAGE
    if configuration.mesh.is_live and isinstance(getattr(options, "start_at", None), int):
        text = "[mesh] is live, and its steps are due at start_time + k dt; leave out --start-at, or give start_time"
        print(f"{configuration.path}: {text}", file=sys.stderr)
        return USAGE
    who = f"{options.role} {options.name}"
    is_ros2 = options.role == "sensor" and configuration.sensors[options.name].ros2 is not None
    if is_ros2 and (missing := ROS2.missing()):
        print(f"{who} listens to ROS 2, and {', '.join(missing)} is not installed: {ROS2.remedy}", file=sys.stderr)
        return COULD_NOT_START
    return with_session(who, lambda: _run(configuration, options))


def _run(configuration: Configuration, options: argparse.Namespace) -> int:
    settings = session_settings(configuration, options)
    if options.role == "recorder":
        from lsu_mesh_services.recorder import run_recorder

        return run_recorder(configuration, options.record, settings, stop=options.stop, serve_port=options.serve)
    from lsu_mesh_services.peer import run_peer

    def make(started: Configuration) -> Node | None:
        try:
            return make_node(started, options)
        except LsuMeshError as error:  # its file, which nobody else reads whole, or what it cannot do with this mesh
            print(error, file=sys.stderr)
            return None

    who, beside = (options.role, options.name), None
    if options.role == "sensor" and configuration.sensors[options.name].ros2 is not None:
        from lsu_mesh_services.ros2.listener import beside_mesh

        beside = beside_mesh(configuration, options)
    return run_peer(configuration, who, make, settings=settings, stop=options.stop, beside=beside)


def _schedule(configuration: Configuration, options: argparse.Namespace) -> Schedule | GridSchedule:
    """By the clock where the mesh is live, else from now, from the time given, or from when standard input says it."""
    if configuration.mesh.is_live:
        return GridSchedule(configuration.grid)
    rate = configuration.mesh.rate
    if options.start_at != "-":
        return Schedule(time.time_ns() if options.start_at is None else options.start_at, rate)
    schedule = Schedule(None, rate)

    def read_start() -> None:
        line = sys.stdin.readline().strip()
        if line.isdigit():
            schedule.start_ns = int(line)

    threading.Thread(target=read_start, daemon=True).start()
    return schedule


def make_node(configuration: Configuration, options: argparse.Namespace) -> Node:
    """The node of a role and name."""
    name, boot = options.name, secrets.token_hex(8)
    if configuration.instances is not None:
        from lsu_mesh.mesh.nodes.bank_nodes import bank_node

        schedule = _schedule(configuration, options) if options.role == "plant" else None
        return bank_node(configuration, options.role, name, boot, schedule=schedule)
    if options.role in ("plant", "sensor"):
        schedule = _schedule(configuration, options)
        if options.role == "plant":
            from lsu_mesh.mesh.nodes.plant import PlantNode

            return PlantNode(configuration, name, boot, schedule)
        if configuration.sensors[name].file is not None:
            from lsu_mesh.mesh.nodes.file_sensor import FileSensorNode

            return FileSensorNode(configuration, name, boot, schedule)
        if configuration.sensors[name].ros2 is not None:
            from lsu_mesh.mesh.nodes.ros2_sensor import Ros2SensorNode

            return Ros2SensorNode(configuration, name, boot)
        from lsu_mesh.mesh.nodes.sensor import SimulatedSensorNode

        return SimulatedSensorNode(configuration, name, boot)
    if options.role == "filter":
        from lsu_mesh.mesh.nodes.filter import FilterNode

        return FilterNode(configuration, name, boot)
    if options.role == "identifier":
        from lsu_mesh.mesh.nodes.identifier import IdentifierNode

        return IdentifierNode(configuration, name, boot)
    from lsu_mesh.mesh.nodes.fusion import FusionNode

    return FusionNode(configuration, name, boot)

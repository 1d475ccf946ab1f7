"""Options of ``lsu-mesh bridge``."""

from __future__ import annotations

import argparse

from lsu_mesh_services.extras import ROS2
from lsu_mesh_services.options.parsing import EXIT_CODES, Commands, add_network, add_overrides, new_command


def add(commands: Commands) -> None:
    """The command ``bridge`` and the networks that estimates go to."""
    parser = new_command(commands, "bridge", "tell estimates and health of a running mesh to another network")
    inner = parser.add_subparsers(dest="network", metavar="NETWORK", required=True)
    ros2 = inner.add_parser(
        "ros2", help="ROS 2: what [network.ros2] publish names",
        description="Tell ROS 2 what [network.ros2] publish names: estimates as PointStamped, health as diagnostics.",
        epilog=f"example:\n  lsu-mesh bridge ros2 -c mesh.toml\n\n{EXIT_CODES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    ros2.add_argument("-c", "--config", metavar="mesh.toml", help="configuration (default: the packaged demo)")
    add_overrides(ros2)
    add_network(ros2)
    parser.set_defaults(handler="lsu_mesh_services.commands.bridge", extra=ROS2, runs_until_stopped=True)

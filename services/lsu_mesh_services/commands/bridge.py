"""``lsu-mesh bridge ros2``: a process beside the mesh that tells ROS 2 what the mesh estimates."""

from __future__ import annotations

import argparse
import sys

from lsu_mesh.mesh.config import Configuration
from lsu_mesh_services.configuration import load_or_explain
from lsu_mesh_services.exit_codes import USAGE
from lsu_mesh_services.ros2.bridge import run_bridge
from lsu_mesh_services.ros2.session import ros2_settings
from lsu_mesh_services.session import session_settings, with_session


def main(options: argparse.Namespace) -> int:
    configuration = load_or_explain(options.config, options, makes_filters=False)
    if configuration is None:
        return USAGE
    if not configuration.network.ros2.publish:
        text = 'nothing is to be told: give publish = [{ estimator = "…", topic = "/…", states = ["…"] }]'
        print(f"{configuration.path}: [network.ros2] {text}", file=sys.stderr)
        return USAGE
    return with_session("bridge ros2", lambda: _run(configuration, options))


def _run(configuration: Configuration, options: argparse.Namespace) -> int:
    settings = session_settings(configuration, options), ros2_settings(configuration, options)
    return run_bridge(configuration, *settings, stop=options.stop)

"""The session with ROS 2, from ``[network.ros2]``; it has nothing to do with that of the mesh."""

from __future__ import annotations

import argparse

from lsu_mesh.mesh.config import Configuration
from lsu_mesh_services.bus import Bus, Clock, NoSession, SessionSettings
from lsu_mesh_services.network.receive_queue import ReceiveQueue
from lsu_mesh_services.network.security import check_endpoints

LOOPBACK = "tcp/127.0.0.1:0"


def ros2_settings(configuration: Configuration, options: argparse.Namespace) -> SessionSettings:
    """How ROS 2 is reached; raises InsecureSession where it would be open to other hosts without ``--insecure``."""
    network = configuration.network.ros2
    listen = network.listen or (LOOPBACK,)
    check_endpoints(listen, (), insecure=options.insecure)
    return SessionSettings(connect=network.connect, listen=listen)


def open_ros2(settings: SessionSettings, clock: Clock, arrivals: ReceiveQueue) -> Bus:
    """A session whose arrivals go into a queue that is there; raises :class:`lsu_mesh_services.bus.NoSession`."""
    try:
        return Bus(settings, clock, arrivals)
    except NoSession as error:
        text = str(error).replace('-X network.entry="tcp/127.0.0.1:PORT"', "[network.ros2] listen")
        raise NoSession(f"ROS 2: {text}") from None

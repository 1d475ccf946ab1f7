"""The process between the mesh and ROS 2: one more subscriber of the mesh, and a node of ROS 2."""

from __future__ import annotations

import sys

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.messages import Health
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.observer import HealthObserver
from lsu_mesh.mesh.ros2_telling import Ros2Telling
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.exit_codes import OK
from lsu_mesh_services.mesh_start import find_start
from lsu_mesh_services.monitoring.subscriber import Watch
from lsu_mesh_services.network.receive_queue import ReceiveQueue
from lsu_mesh_services.ros2.publishers import Ros2Publishers
from lsu_mesh_services.ros2.session import open_ros2
from lsu_mesh_services.stop import Stop

LOOK_S = 1.0
FOREIGN_NS = 5 * SECOND
"""When messages were refused, and none taken, for so long, the mesh is another one: its start is asked for again."""


def run_bridge(configuration: Configuration, mesh: SessionSettings, ros2: SessionSettings, *, stop: Stop) -> int:
    """Until it is told to stop; a mesh that is started later, or again, is found."""
    clock = Clock()
    with open_ros2(ros2, clock, ReceiveQueue()) as ros2_bus:
        publishers = Ros2Publishers(configuration, ros2_bus, clock, Ros2Telling(configuration).topics)
        told = ", ".join(one.topic for one in configuration.network.ros2.publish)
        print(f"bridge ros2: tells {told}", file=sys.stderr)
        while not stop:
            with Bus(mesh, clock) as bus:
                started = find_start(configuration, bus, clock, LOOK_S)
                if started is not None:
                    _tell(started, bus, clock, publishers=publishers, stop=stop)
    return OK


def _tell(configuration: Configuration, bus: Bus, clock: Clock, *, publishers: Ros2Publishers, stop: Stop) -> None:
    """What comes of the mesh, until it is another one."""
    telling, observer = Ros2Telling(configuration), HealthObserver(configuration, clock.now())
    watch = Watch(configuration, bus, clock, stop)
    addresses = telling.addresses
    watch.listen([*addresses, *(("health", name) for _, name in addresses)])
    next_look, taken_ns = clock.now() + SECOND, clock.now()
    for heard in watch.received():
        now = clock.now()
        if heard is not None and heard.message is None:
            observer.record_presence(heard.name, heard.is_there)
        elif heard is not None and heard.message is not None:
            taken_ns = now
            if isinstance(heard.message, Health):
                observer.record(heard.message, now)
            publishers.tell(telling.receive(heard.message))
        if now >= next_look:
            next_look = now + SECOND
            publishers.tell(telling.diagnostics(observer.peers(now), now))
            if watch.admission.refused.total() and now - taken_ns > FOREIGN_NS:
                watch.tell_refused()
                return

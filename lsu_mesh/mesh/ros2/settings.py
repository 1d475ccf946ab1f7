"""What a configuration says of a ROS 2 network and of its topics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

DialectName = Literal["rmw_zenoh", "ros2dds"]
"""Who puts ROS 2 on Zenoh: the middleware of the ROS nodes themselves, or a bridge from DDS."""
Distro = Literal["humble", "iron", "jazzy", "kilted", "lyrical"]
"""A release of ROS 2, which says the fields of its message types."""
Stamp = Literal["header", "receive"]
"""The time of a measurement: that of its header, or when it came."""
DISTROS: tuple[Distro, ...] = get_args(Distro)
DIALECTS: tuple[DialectName, ...] = get_args(DialectName)
ROUTER = "tcp/localhost:7447"
"""Where rmw_zenohd, the router of ROS 2, listens."""


@dataclass(frozen=True)
class Ros2Topic:
    """A topic that is measured: ``fields`` are paths into its message, one per row of C."""

    topic: str
    type: str
    fields: tuple[str, ...]
    stamp: Stamp


@dataclass(frozen=True)
class Ros2Publication:
    """An entry of ``[network.ros2] publish``: an estimator that is told as ``geometry_msgs/msg/PointStamped``."""

    estimator: str
    topic: str
    states: tuple[str, ...]
    """Those that are x, y and z."""
    frame_id: str
    diagnostics: bool
    """Whether its bounds and its health go out as ``diagnostic_msgs/msg/DiagnosticArray`` too."""


@dataclass(frozen=True)
class Ros2Network:
    """``[network.ros2]``: a Zenoh network of its own, beside that of the mesh."""

    connect: tuple[str, ...] = (ROUTER,)
    listen: tuple[str, ...] = ()
    domain_id: int = 0
    dialect: DialectName = "rmw_zenoh"
    namespace: str = "/"
    distro: Distro = "jazzy"
    publish: tuple[Ros2Publication, ...] = ()

"""The dialect of a network, by its name."""

from __future__ import annotations

from typing import TypeAlias

from lsu_mesh.mesh.ros2.rmw_zenoh import RmwZenoh
from lsu_mesh.mesh.ros2.ros2dds import Ros2Dds
from lsu_mesh.mesh.ros2.settings import Ros2Network

Dialect: TypeAlias = RmwZenoh | Ros2Dds


def dialect_of(network: Ros2Network) -> Dialect:
    """That of ``[network.ros2] dialect``."""
    return RmwZenoh(network) if network.dialect == "rmw_zenoh" else Ros2Dds(network)

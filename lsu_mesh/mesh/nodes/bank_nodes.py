"""The nodes of a mesh of banks, by role."""

from __future__ import annotations

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.nodes.bank_filter import BankFilterNode
from lsu_mesh.mesh.nodes.bank_fusion import BankFusionNode
from lsu_mesh.mesh.nodes.bank_plant import BankPlantNode
from lsu_mesh.mesh.nodes.bank_sensor import BankSensorNode
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.nodes.schedule import GridSchedule, Schedule


def bank_node(
    configuration: Configuration, role: str, name: str, boot: str, *, schedule: Schedule | GridSchedule | None
) -> Node:
    """The node of a plant, which needs a schedule, a sensor, a filter or a fusion of a mesh of banks."""
    if role == "plant":
        assert schedule is not None
        return BankPlantNode(configuration, name, boot, schedule)
    if role == "sensor":
        return BankSensorNode(configuration, name, boot)
    return BankFilterNode(configuration, name, boot) if role == "filter" else BankFusionNode(configuration, name, boot)

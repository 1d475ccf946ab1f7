"""The mesh as a graph: its peers, who listens to whom, and who is there."""

from __future__ import annotations

import rerun as rr

from lsu_mesh.mesh.config import Configuration
from lsu_mesh_services.recording.palette import ABSENT, OTHER, Color
from lsu_mesh_services.recording.timeline import Moment, Stream, Timelines, one_row

ENTITY = "/topology"
ROLES = ("plant", "sensor", "filter", "fusion", "identifier", "recorder")
COLUMN_WIDTH, ROW_HEIGHT = 190.0, 70.0


class Topology:
    """Draws the graph of peers, again whenever one comes or goes."""

    def __init__(
        self,
        stream: Stream,
        timelines: Timelines,
        configuration: Configuration,
        colors: dict[str, Color],
    ) -> None:
        self._stream = stream
        self._timelines = timelines
        self._colors = colors
        self._roles = {name: role for role, name in configuration.peers()}
        self._alive: dict[str, bool] = dict.fromkeys(self._roles, False)
        self._latest: Moment | None = None
        stream.log(ENTITY, rr.GraphEdges(edges=links(configuration), graph_type="directed"), static=True)

    def peer_changed(self, role: str, name: str, alive: bool, moment: Moment) -> None:
        """A peer came or went."""
        self._roles.setdefault(name, role)
        self._alive[name] = alive
        self._latest = moment

    def flush(self) -> None:
        """Draw the graph if it changed."""
        if self._latest is not None:
            moment, self._latest = self._latest, None
            times = self._timelines.columns([moment])
            self._stream.send_columns(ENTITY, times, self._nodes())

    def _nodes(self) -> list[rr.ComponentColumn]:
        names = list(self._roles)
        nodes = rr.GraphNodes(
            node_ids=names,
            labels=[f"{self._roles[name]} {name}" if self._roles[name] != name else name for name in names],
            colors=[self._color(name) for name in names],
            positions=self._places(names),
            show_labels=True,
        )
        return one_row(nodes)

    def _color(self, name: str) -> Color:
        return self._colors.get(name, OTHER) if self._alive.get(name) else ABSENT

    def _places(self, names: list[str]) -> list[tuple[float, float]]:
        """Roles from left to right, the peers of one role below each other around the middle line."""
        roles = [self._roles[name] if self._roles[name] in ROLES else ROLES[-1] for name in names]
        columns = [role for role in ROLES if role in roles]
        seen: dict[str, int] = {}
        places = []
        for role in roles:
            i = seen[role] = seen.get(role, -1) + 1
            y = (i - 0.5 * (roles.count(role) - 1)) * ROW_HEIGHT
            places.append((columns.index(role) * COLUMN_WIDTH, y))
        return places


def links(configuration: Configuration) -> list[tuple[str, str]]:
    """Who sends to whom; the recorder, which listens to all, is left out."""
    plant = configuration.plant
    edges = []
    if plant is not None:
        edges += [(plant.name, sensor.name) for sensor in configuration.sensors.values() if sensor.is_simulated]
    for name, settings in configuration.filters.items():
        edges += [(sensor, name) for sensor in settings.sensors]
    for name, fusion in configuration.fusion.items():
        edges += [(source, name) for source in fusion.sources]
    for name, identifier in configuration.identifiers.items():
        edges += [(sensor, name) for sensor in identifier.sensors]
        edges += [(name, other) for other, settings in configuration.filters.items() if settings.adopt == name]
    return edges

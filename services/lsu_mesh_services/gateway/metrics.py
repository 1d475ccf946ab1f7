"""The mesh in numbers for Prometheus and other readers of OpenMetrics."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from prometheus_client import CollectorRegistry
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, StateSetMetricFamily
from prometheus_client.exposition import choose_encoder
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.messages import Posterior
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.observer import LEVELS
from lsu_mesh_services.gateway.board import Board
from lsu_mesh_services.gateway.event_stream import Clients

GAUGES = frozenset({"links", "queue", "queue_ms", "step_ms"})
"""Of what peers tell with their counters, what goes down too."""


class MeshMetrics(Collector):
    """Reads the board when it is asked; keeps nothing itself."""

    def __init__(self, configuration: Configuration, board: Board, clients: Clients, now: Callable[[], int]) -> None:
        self._states = configuration.base_model.states
        self._board, self._clients, self._now = board, clients, now

    def collect(self) -> Iterator[Metric]:
        """All families."""
        yield from self._of_peers()
        yield from self._of_estimates()
        yield from self._of_gateway()

    def _of_peers(self) -> Iterator[Metric]:
        labels = ["role", "peer"]
        health = StateSetMetricFamily("lsu_peer_health", "Level of a peer.", labels=labels)
        age = GaugeMetricFamily("lsu_peer_heartbeat_age_seconds", "Time since the last heartbeat.", labels=labels)
        step = GaugeMetricFamily("lsu_peer_step", "Newest step of a peer.", labels=labels)
        gauges = GaugeMetricFamily("lsu_peer_gauge", "What a peer measures of itself.", labels=[*labels, "what"])
        counts = CounterMetricFamily("lsu_peer_count", "What a peer counts since it started.", labels=[*labels, "what"])
        for peer in self._board.peers:
            who = [peer.role, peer.name]
            health.add_metric(who, {level: level == peer.level for level in LEVELS})
            step.add_metric(who, peer.step)
            if peer.age_ns is not None:
                age.add_metric(who, peer.age_ns / SECOND)
            for what, value in sorted(peer.counters.items()):
                (gauges if what in GAUGES else counts).add_metric([*who, what], value)
        yield from (health, age, step, gauges, counts)

    def _of_estimates(self) -> Iterator[Metric]:
        labels = ["topic", "estimator"]
        width = GaugeMetricFamily("lsu_estimate_width", "Upper minus lower bound.", labels=[*labels, "state"])
        age = GaugeMetricFamily("lsu_estimate_age_seconds", "Time since the newest estimate came.", labels=labels)
        step = GaugeMetricFamily("lsu_estimate_step", "Step of the newest estimate.", labels=labels)
        count = CounterMetricFamily("lsu_estimates", "Estimates that came to the gateway.", labels=labels)
        for entry in self._board.newest():
            message = entry.message
            assert isinstance(message, Posterior)
            who = [message.topic, message.name]
            for state, lower, upper in zip(self._states, message.lower, message.upper, strict=True):
                width.add_metric([*who, state], upper - lower)
            age.add_metric(who, max(0, self._now() - entry.arrival_ns) / SECOND)
            step.add_metric(who, message.step)
            count.add_metric(who, self._board.counts[message.name])
        yield from (width, age, step, count)

    def _of_gateway(self) -> Iterator[Metric]:
        connection = self._board.connection
        yield GaugeMetricFamily("lsu_gateway_links", "Peers and routers it is connected to.", connection.links)
        yield GaugeMetricFamily("lsu_gateway_clients", "Streams that are open.", self._clients.open)
        yield CounterMetricFamily("lsu_gateway_refused_messages", "Messages it refused.", connection.refused)


def exposition(collector: Collector, accept: str) -> tuple[bytes, str]:
    """Body and content type: OpenMetrics where the reader takes it, else Prometheus' own text."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(collector)
    encode, content_type = choose_encoder(accept)
    body: bytes = encode(registry)
    return body, content_type

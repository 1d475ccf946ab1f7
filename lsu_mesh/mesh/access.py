"""Who publishes, reads, asks and answers what: from the configuration alone, for the nodes and for access control."""

from __future__ import annotations

from typing import NamedTuple

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.keys import TOPICS, instance_key, key, last_key, model_key

PUBLISHES = {
    "plant": ("truth", "input"),
    "sensor": ("measurement",),
    "filter": ("prediction", "smoothed", "posterior"),
    "fusion": ("fused",),
    "identifier": ("bounds",),
    "recorder": (),
}
"""Topics of each role, the one that tells its steps last, besides those of every peer."""
BANK_TOPICS = {
    "truth": "bank_truth",
    "measurement": "bank_measurement",
    "posterior": "bank_posterior",
    "fused": "bank_fused",
}
"""Topics of a mesh of banks, by the topics that they stand for; all others of a role are not published there."""
EVERY_PEER = ("health", "event")


class Access(NamedTuple):
    """Key expressions of one peer."""

    publishes: tuple[str, ...]
    reads: tuple[str, ...]
    asks: tuple[str, ...]
    answers: tuple[str, ...]


def truth_is_known(configuration: Configuration) -> bool:
    """Whether the plant tells its state: a sensor is simulated on it. Real measurements come without a truth."""
    return configuration.plant is not None and any(one.is_simulated for one in configuration.sensors.values())


def published_topics(configuration: Configuration, role: str, name: str) -> tuple[str, ...]:
    """Topics of one peer, besides those of every peer: a filter without a lag publishes no smoothed sets."""
    if configuration.instances is not None:
        return tuple(BANK_TOPICS[topic] for topic in PUBLISHES[role] if topic in BANK_TOPICS)
    smooths = role == "filter" and configuration.filters[name].lag > 0
    return tuple(topic for topic in PUBLISHES[role] if topic != "smoothed" or smooths)


def taken_predictions(configuration: Configuration) -> set[str]:
    """Filters whose predictions other filters take; those of the rest are computed only while somebody listens."""
    listed = [address for name in configuration.filters for address in _of_filter(configuration, name)]
    return {name for topic, name in listed if topic == "prediction"}


def recorded(configuration: Configuration) -> list[tuple[str, str]]:
    """``(topic, name)`` of what a recorder listens to: all, but of the predictions those that sets are made from."""
    if configuration.instances is not None:
        return [(topic, "*") for topic in recorded_topics(configuration)]
    topics = [(topic, "*") for topic in recorded_topics(configuration) if topic != "prediction"]
    names = ["*"] if configuration.recorder.predictions else sorted(taken_predictions(configuration))
    return [*topics, *(("prediction", name) for name in names)]


def subscriptions(configuration: Configuration, role: str, name: str) -> list[tuple[str, str]]:
    """``(topic, name)`` of everything that a node listens to."""
    if configuration.instances is not None:
        return [(BANK_TOPICS[topic], one) for topic, one in _of_bank(configuration, role, name)]
    if role == "sensor":
        return _truth(configuration) if configuration.sensors[name].is_simulated else []
    if role == "filter":
        return _of_filter(configuration, name)
    if role == "identifier":
        sensors = configuration.identifiers[name].sensors
        return [*(("measurement", sensor) for sensor in sensors), *_inputs(configuration)]
    if role == "fusion":
        sources = configuration.fusion[name].sources
        listed = [("fused" if source in configuration.fusion else "posterior", source) for source in sources]
        return [*listed, *_inputs(configuration)]
    return []


def recorded_topics(configuration: Configuration) -> tuple[str, ...]:
    """Topics that a mesh has, besides the tokens of its peers."""
    banks = set(BANK_TOPICS.values())
    return tuple(
        topic for topic in TOPICS if topic != "live" and (topic not in banks or configuration.instances is not None)
    )


def access(configuration: Configuration, role: str, name: str) -> Access:
    """All that a peer of the configuration may do on the mesh."""
    mesh = configuration.mesh.name
    topics = (*published_topics(configuration, role, name), *EVERY_PEER)
    if role == "recorder":
        reads = tuple(key(mesh, topic, other) for topic, other in recorded(configuration))
    else:
        listed = [*subscriptions(configuration, role, name), ("health", name)]  # its own: whether it runs twice
        reads = tuple(key(mesh, topic, other) for topic, other in listed)
    asks = (model_key(mesh), *((last_key(mesh, name),) if role == "filter" else ()))
    return Access(tuple(key(mesh, topic, name) for topic in topics), reads, asks, _answers(configuration, role, name))


def reader_access(configuration: Configuration) -> Access:
    """What a subscriber may do: read all, ask all, publish nothing."""
    mesh = configuration.mesh.name
    reads = tuple(key(mesh, topic, "*") for topic in recorded_topics(configuration))
    asks = [model_key(mesh), last_key(mesh, "*")]
    if configuration.instances is not None:
        asks += [instance_key(mesh, topic, "*", "*") for topic in ("posterior", "fused")]
    return Access((), reads, tuple(asks), ())


def _answers(configuration: Configuration, role: str, name: str) -> tuple[str, ...]:
    """Queries that a peer answers, besides those on what it publishes."""
    mesh = configuration.mesh.name
    if configuration.instances is not None and role in ("filter", "fusion"):
        topic = "posterior" if role == "filter" else "fused"
        last = () if role == "filter" else tuple(last_key(mesh, one) for one in configuration.fusion[name].sources)
        return (model_key(mesh), instance_key(mesh, topic, name, "*"), *last)
    if role == "fusion":
        return (model_key(mesh), *(last_key(mesh, source) for source in configuration.fusion[name].sources))
    return (model_key(mesh),) if role == "filter" else ()


def _of_bank(configuration: Configuration, role: str, name: str) -> list[tuple[str, str]]:
    """As :func:`subscriptions`, by the topics of single targets."""
    if role == "sensor":
        return _truth(configuration) if configuration.sensors[name].is_simulated else []
    if role == "filter":
        return [("measurement", sensor) for sensor in configuration.filters[name].sensors]
    return [("posterior", source) for source in configuration.fusion[name].sources] if role == "fusion" else []


def _truth(configuration: Configuration) -> list[tuple[str, str]]:
    assert configuration.plant is not None, "a simulated sensor has a plant"
    return [("truth", configuration.plant.name)]


def _inputs(configuration: Configuration) -> list[tuple[str, str]]:
    has_inputs = configuration.plant is not None and configuration.base_model.input_count > 0
    return [("input", configuration.plant.name)] if configuration.plant is not None and has_inputs else []


def _of_filter(configuration: Configuration, name: str) -> list[tuple[str, str]]:
    """Measurements, inputs, fused sets of the fusions that use the filter, and what is transferred to it."""
    settings = configuration.filters[name]
    listed = [*(("measurement", sensor) for sensor in settings.sensors), *_inputs(configuration)]
    fused = {fusion.name for fusion in configuration.fusion.values() if name in fusion.sources}
    if settings.transfer == "fused":
        fused |= set(settings.transfer_from)
    elif settings.transfer != "off":
        listed += [("prediction", source) for source in settings.transfer_from]
    listed += [("bounds", settings.adopt)] if settings.adopt else []
    return [*listed, *(("fused", fusion) for fusion in sorted(fused))]

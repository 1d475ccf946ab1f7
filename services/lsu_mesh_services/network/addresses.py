"""Topics as people write them: ``posterior/cz``, ``posterior/*``, ``posterior``, or a whole key."""

from __future__ import annotations

from lsu_mesh.errors import LsuMeshError
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.config.problem import nearest
from lsu_mesh.mesh.flows import flows
from lsu_mesh.mesh.keys import PREFIX

Addresses = list[tuple[str, str]]
"""``(topic, name)`` of each key."""


class WrongAddress(LsuMeshError):
    """There is no such topic or publisher; the text names the nearest one."""


def read_address(configuration: Configuration, text: str) -> Addresses:
    """The keys of the configuration that ``text`` means, at least one.

    Raises
    ------
    WrongAddress
        When no peer of the configuration publishes it.
    """
    known = [(flow.topic, flow.name) for flow in flows(configuration)]
    own = f"{PREFIX}/{configuration.mesh.name}/"
    if text.startswith(f"{PREFIX}/") and not text.startswith(own):
        raise WrongAddress(f"{text}: the mesh of this configuration is {configuration.mesh.name!r}: {own}TOPIC/NAME")
    topic, _, name = text.removeprefix(own).partition("/")
    topics = sorted({known_topic for known_topic, _ in known})
    if topic not in topics:
        raise WrongAddress(f"{text}: no peer publishes a topic {topic!r}; {_nearest(topic, name, topics)}")
    found = [address for address in known if address[0] == topic and name in ("", "*", "**", address[1])]
    if not found:
        publishers = [other for known_topic, other in known if known_topic == topic]
        raise WrongAddress(f"{text}: no {name!r} publishes {topic}; {_nearest_name(topic, name, publishers)}")
    return found


def _nearest(topic: str, name: str, topics: list[str]) -> str:
    words = nearest(topic, topics)
    return words.replace('"?', f'/{name}"?') if name else words


def _nearest_name(topic: str, name: str, names: list[str]) -> str:
    return nearest(f"{topic}/{name}", [f"{topic}/{other}" for other in names])

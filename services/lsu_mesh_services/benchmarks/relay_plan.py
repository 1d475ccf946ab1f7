"""What each process of the relay reads and publishes: the keys, sizes and order of the mesh, without its work."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NamedTuple, Self

from lsu_mesh.mesh.access import access, subscriptions
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.keys import key

TRIGGERS = {"sensor": ("truth",), "filter": ("measurement",), "fusion": ("posterior",)}
"""Topics of a step all of which a role awaits, from each peer that it reads, before it publishes."""


class RelayPart(NamedTuple):
    """One process of the relay: when it has step k of every key in ``awaits``, it publishes step k of every key in
    ``sends``, in order, with so many bytes."""

    label: str
    announces: tuple[str, ...]
    reads: tuple[str, ...]
    live: tuple[str, ...]
    """Keys that it reads without history and recovery, as the mesh does."""
    awaits: tuple[str, ...]
    sends: dict[str, int]
    alive: str
    """Key of its liveliness token."""
    cache: int
    """Messages that each publisher keeps for those who missed them."""
    links: int
    """Others of the relay, the subscriber included: it says that it is there when it is linked to all of them."""
    rate: float
    """Steps a second of the first part, which awaits nothing and keeps the time; 0 for the others."""

    def text(self) -> str:
        """As one argument of a process."""
        return json.dumps(self._asdict())

    @classmethod
    def read(cls, text: str) -> Self:
        """The way back from :meth:`text`."""
        values: dict[str, Any] = json.loads(text)
        fields: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}
        return cls(**fields)


def relay_plan(configuration: Configuration, sizes: Mapping[str, int], *, recorder: bool) -> list[RelayPart]:
    """A part for each peer of the configuration, the plant's last, with ``sizes`` of the messages at each key."""
    peers = [peer for peer in configuration.peers() if recorder or peer[0] != "recorder"]
    return [_part(configuration, role, name, sizes=sizes, links=len(peers)) for role, name in peers]


def _part(configuration: Configuration, role: str, name: str, *, sizes: Mapping[str, int], links: int) -> RelayPart:
    mesh, may = configuration.mesh.name, access(configuration, role, name)
    own_health = key(mesh, "health", name)
    awaited = TRIGGERS.get(role, ())
    return RelayPart(
        label=f"{role} {name}",
        announces=may.publishes,
        reads=tuple(address for address in may.reads if address != own_health),
        live=() if role == "recorder" else (own_health,),
        awaits=tuple(key(mesh, topic, other) for topic, other in subscriptions(configuration, role, name)
                     if topic in awaited),
        sends={address: sizes[address] for address in may.publishes if address in sizes},
        alive=key(mesh, "live", name),
        cache=configuration.cached,
        links=links,
        rate=configuration.mesh.rate if role == "plant" else 0.0,
    )  # fmt: skip

"""What is told of the graph of ROS 2: nodes, publishers and subscriptions."""

from __future__ import annotations

from typing import Literal, NamedTuple

HUMBLE_HASH = "TypeHashNotSupported"
"""Stands for the hash of a type in ROS 2 Humble, which has none."""


class Node(NamedTuple):
    """A node of ROS 2 in a Zenoh session; ``number`` is its own within the session."""

    session: str
    number: int
    name: str


class Endpoint(NamedTuple):
    """A publisher or a subscription, with a number of its own within the session."""

    kind: Literal["MP", "MS"]
    number: int
    topic: str
    type: str
    type_hash: str
    depth: int


class Announced(NamedTuple):
    """A publisher that somebody else has: by which node, where that is known, and of which type."""

    node: str
    type: str


def topic_hash_text(type_name: str, found: str, expected: str, distro: str) -> str:
    """Why data of another hash are refused: their fields may be others."""
    if found == HUMBLE_HASH:
        remedy = 'they are sent by ROS 2 Humble: set [network.ros2] distro = "humble"'
    elif expected == HUMBLE_HASH:
        remedy = 'they are sent by a later release: set [network.ros2] distro, as "jazzy"'
    else:
        remedy = "the sender's fields are others: set [network.ros2] distro to its release"
    differs = f"has the hash {_short(found)}, that of ROS 2 {distro} is {_short(expected)}"
    return f"{type_name} of the sender {differs}; {remedy}"


def _short(type_hash: str) -> str:
    return type_hash if len(type_hash) < 24 else f"{type_hash[:19]}…"

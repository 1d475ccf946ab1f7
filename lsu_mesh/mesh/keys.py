"""Key expressions of the mesh: ``lsu/v1/<mesh>/<topic>/<name>``."""

from __future__ import annotations

import functools
import re
from typing import NamedTuple

PREFIX = "lsu/v1"
TOPICS = (
    "truth", "input", "measurement", "prediction", "posterior", "smoothed", "fused", "bounds", "health", "event",
    "live", "bank_truth", "bank_measurement", "bank_posterior", "bank_fused",
)  # fmt: skip
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
MAX_LENGTH = len(PREFIX) + 3 * 65
"""Longest key in characters."""
NAME_RULE = "1 to 64 ASCII letters, digits, '_', '-' or '.', the first a letter or a digit"

READER = "viewer"
"""Name in the certificate of those who read everything and publish nothing: subscribers, tools, ``lsu-mesh run``."""
ROUTER = "router"
"""Name in the certificate of a router, which passes on what others send and is trusted to check whose it is."""
AUTHORITY = "ca"
RESERVED = (READER, ROUTER, AUTHORITY)
"""Names that no peer may have where certificates carry names."""


class Address(NamedTuple):
    """What a key says: the mesh, the topic and the name of its one publisher."""

    mesh: str
    topic: str
    name: str


def is_name(text: str) -> bool:
    """Whether ``text`` may be the name of a mesh or a peer."""
    return NAME.fullmatch(text) is not None


def key(mesh: str, topic: str, name: str) -> str:
    """Key of one publisher's topic; ``name="**"`` makes the expression for all of them."""
    if topic not in TOPICS:
        raise ValueError(f"no topic {topic!r}; topics: {', '.join(TOPICS)}")
    return f"{PREFIX}/{mesh}/{topic}/{name}"


def model_key(mesh: str) -> str:
    """Key of the query that returns the model."""
    return f"{PREFIX}/{mesh}/model"


def instance_key(mesh: str, topic: str, name: str, instance: int | str) -> str:
    """Key of the query that returns the last set of one instance of a bank; ``"*"``: of each of them."""
    return f"{PREFIX}/{mesh}/{topic}/{name}/{instance}"


def last_key(mesh: str, name: str) -> str:
    """Key of the query that returns the last sound posterior of the filter ``name``."""
    return f"{PREFIX}/{mesh}/last/{name}"


def parse(text: str) -> Address | None:
    """The address in a key, or ``None`` when it is no key of this protocol."""
    return _parsed(text) if len(text) <= MAX_LENGTH else None


@functools.lru_cache(maxsize=4096)
def _parsed(text: str) -> Address | None:
    chunks = text.split("/")
    if len(chunks) != 5 or "/".join(chunks[:2]) != PREFIX or chunks[3] not in TOPICS:
        return None
    return Address(chunks[2], chunks[3], chunks[4]) if is_name(chunks[2]) and is_name(chunks[4]) else None

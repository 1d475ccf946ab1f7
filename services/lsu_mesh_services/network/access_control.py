"""Access control of Zenoh, generated from the configuration: who may send what over which link.

Every session checks both directions of each of its links against the name in the other end's certificate. What comes
in is limited to the peer's own keys, what goes out to the keys that the peer may read. Advanced publishers and
subscribers talk beside the key, at ``<key>/@adv/**``, which ``**`` does not cover.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from lsu_mesh.mesh.access import Access, access, reader_access
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.keys import PREFIX, READER, ROUTER, key

Rule = dict[str, Any]
DECLARATIONS = (
    "declare_subscriber", "declare_queryable", "query", "liveliness_token", "liveliness_query",
    "declare_liveliness_subscriber",
)  # fmt: skip
"""Messages that carry no data; what they ask for is checked where they arrive."""
DATA = ("put", "delete", "reply")


def zenoh_access_control(configuration: Configuration) -> dict[str, Any]:
    """The value of Zenoh's setting ``access_control``: all is forbidden but what the roles need."""
    mesh = configuration.mesh.name
    everything = _with_beside([f"{PREFIX}/{mesh}/**"])
    rules = [_rule("all-in", "ingress", (*DECLARATIONS, *DATA), everything)]
    rules += [_rule("all-out", "egress", (*DECLARATIONS, *DATA), everything)]
    rules += [_rule("ask-out", "egress", DECLARATIONS, everything)]
    allowed = {ROUTER: ["all-in", "all-out"]}
    peers = [(name, access(configuration, role, name), True) for role, name in configuration.peers()]
    for name, may, has_token in [*peers, (READER, reader_access(configuration), False)]:
        own = _of_peer(mesh, name, may, has_token)
        rules += own
        allowed[name] = ["ask-out", *(rule["id"] for rule in own)]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "cert_common_names": [name]} for name in allowed],
        "policies": [{"id": name, "rules": ids, "subjects": [name]} for name, ids in allowed.items()],
    }


def _of_peer(mesh: str, name: str, may: Access, has_token: bool) -> list[Rule]:
    """What one peer may publish, declare, query and receive."""
    live = key(mesh, "live", "*")
    tokens = _beside(may.publishes) + ([key(mesh, "live", name)] if has_token else [])
    own, read = _with_beside(may.publishes), _with_beside(may.reads)
    rules = [
        _rule(f"{name}: publish", "ingress", ("put", "delete"), own),
        _rule(f"{name}: answer", "ingress", ("reply", "declare_queryable"), [*own, *may.answers]),
        _rule(f"{name}: be there", "ingress", ("liveliness_token",), tokens),
        _rule(f"{name}: subscribe", "ingress", ("declare_subscriber",), read),
        _rule(f"{name}: ask", "ingress", ("query",), [*read, *may.asks]),
        _rule(
            f"{name}: watch", "ingress", ("liveliness_query", "declare_liveliness_subscriber"),
            [live, *_beside(may.reads)],
        ),
        _rule(f"{name}: be told", "egress", DATA, [*read, *may.asks]),
    ]  # fmt: skip
    return [rule for rule in rules if rule["key_exprs"]]


def _rule(identity: str, flow: str, messages: Iterable[str], keys: Sequence[str]) -> Rule:
    return {
        "id": identity,
        "permission": "allow",
        "flows": [flow],
        "messages": list(messages),
        "key_exprs": list(keys),
    }


def _with_beside(keys: Sequence[str]) -> list[str]:
    return [*keys, *_beside(keys)]


def _beside(keys: Sequence[str]) -> list[str]:
    return [f"{expression}/@adv/**" for expression in keys]

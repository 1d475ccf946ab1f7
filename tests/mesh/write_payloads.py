"""Payloads of every topic and kind of set, to keep of a version: ``python tests/mesh/write_payloads.py FILE``.

Each line of the file says what the payload is, its topic, its fields in JSON, and its bytes in hexadecimal digits.
Files that are released are never written again: they show what others have on their disks and send.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgpack

from lsu_mesh.mesh.messages import TYPES, decode, encode

Fields = dict[str, Any]
COMMON: Fields = {
    "v": 1, "boot": "0123456789abcdef", "seq": 41, "step": 42, "sent_ns": 1_700_000_000_020_000_000,
    "origin_ns": 1_700_000_000_018_000_000, "model": "b015983c54e6e4d2",
}  # fmt: skip
LOWER, UPPER = [-0.1, 5e-324], [0.30000000000000004, 1.7976931348623157e308]
SETS: dict[str, Fields] = {
    "orthotope": {"lower": LOWER, "upper": UPPER},
    "parallelotope": {"center": [0.1, -0.0], "generators": [[0.1, 0.2], [0.0, 1e-300]]},
    "zonotope": {"center": [0.1, 0.5], "generators": [[0.1, 0.2, 0.3], [0.0, 0.1, 0.7]]},
    "flat zonotope": {"center": [0.1, 0.5], "generators": [[], []]},
    "constrained_zonotope": {
        "center": [0.1, 0.5], "generators": [[0.1, 0.2, 0.3], [0.0, 0.1, 0.7]], "A": [[1.0, -0.5, 0.1]], "b": [0.25],
    },
}  # fmt: skip
REFERENCES = [["input", "plant/plant", "0011223344556677", 40], ["measurement", "sensor/s1", "8899aabbccddeeff", 2**62]]
ESTIMATE: Fields = {
    "lower": LOWER, "upper": UPPER, "epoch": 3, "guarantee": "learned",
    "descent": [["filter/cz", "89abcdef01234567", 1]],
    "base": ["posterior", "filter/box", "0123456789abcdef", 40], "used": REFERENCES, "missing": ["s2"],
    "bounds": {"rho": [0.1, 0.0], "r": [0.3]}, "algorithm": 2,
}  # fmt: skip
POSTERIOR: Fields = ESTIMATE | {
    "src": "filter/box", "kind": "LSUO", "point": [0.1, 0.75], "log_volume": -0.6931471805599453, "volume_of": "hull",
    "status": "inconsistent", "revision": 1, "cause": "measurement of s1", "gain": 0.1, "gain_of": "hull",
    "point_rule": "mean", "mean": [0.1, 5e-324], "covariance": [[0.1, -0.0], [-0.0, 1e-300]],
}  # fmt: skip
PLAIN: Fields = POSTERIOR | {
    "status": "ok", "base": "prior", "used": [], "missing": [], "cause": None, "descent": [], "gain": None,
    "log_volume": None, "guarantee": "declared", "gain_of": None, "point_rule": None, "algorithm": None,
    "mean": None, "covariance": None,
}  # fmt: skip


def typed(name: str) -> Fields:
    """A set as a message holds it."""
    return {"type": name.removeprefix("flat ")} | SETS[name]


def cases() -> Iterator[tuple[str, str, Fields]]:
    """What it is, its topic and its fields."""
    yield "truth", "truth", {"src": "plant/plant", "x": [0.1, -0.8]}
    yield "input", "input", {"src": "plant/plant", "u": [0.4], "time_ns": 1_700_000_000_000_000_000}
    measured = {"src": "sensor/s1", "y": [0.7, None], "time_ns": 840_000_000, "time_error_ns": 2_000_000}
    yield "measurement", "measurement", measured
    yield "measurement of nothing", "measurement", measured | {"y": [None], "time_ns": 0, "time_error_ns": None}
    yield "measurement without a step", "measurement", measured | {"step": 0}
    predicted = ESTIMATE | {"src": "filter/box", "y_lower": [-0.3], "y_upper": [1.1], "y_point": [0.4]}
    predicted |= {"point_rule": "mean"}
    for name in SETS:
        yield f"prediction, {name}", "prediction", predicted | {"support": typed(name), "missing": ["input"]}
        yield f"posterior, {name}", "posterior", POSTERIOR | {"support": typed(name)}
    yield "smoothed", "smoothed", ESTIMATE | {
        "src": "filter/box", "support": typed("constrained_zonotope"), "lag": 5, "revision": 1,
        "base": ["posterior", "filter/box", "0123456789abcdef", 46],
    }  # fmt: skip
    parts = {"type": "intersection", "parts": [typed(name) for name in SETS]}
    yield "posterior, intersection", "posterior", POSTERIOR | {"support": parts}
    for base in ("prior", "reach", "domain", "sources"):
        yield f"posterior from {base}", "posterior", PLAIN | {"support": typed("orthotope"), "base": base}
    for status in ("ok", "predicted", "restarted"):
        yield f"posterior, {status}", "posterior", PLAIN | {"support": typed("orthotope"), "status": status}
    fused = POSTERIOR | {"src": "fusion/main", "kind": "fusion", "support": parts}
    rejected = [{"source": "cz", "reason": "disjoint"}]
    yield "fused, relaxed", "fused", fused | {
        "policy": "relaxed", "faults": 1, "rejected": rejected, "quarantined": ["para"],
    }  # fmt: skip
    yield "fused, intersect", "fused", fused | {"policy": "intersect", "faults": 0, "rejected": [], "quarantined": []}
    bounds = {"rho": [0.1, 0.0], "r": {"s1": [0.36]}, "factor": 2.0, "margin": 1.2, "first": 1, "last": 42}
    yield "bounds", "bounds", bounds | {"src": "identifier/noise", "explained": False, "adopt_at": 62}
    yield "bounds that fit", "bounds", bounds | {"src": "identifier/noise", "explained": True, "adopt_at": None}
    health = {"role": "filter", "level": "WARN", "reasons": ["waits for s1 – 0.6 s"], "counters": {"received": 84.0}}
    more = {"started_ns": 1_700_000_000_000_000_000, "host": "lab-1"}
    yield "health", "health", health | more | {"src": "filter/box"}
    about = {"sensor": "s1", "gap": 0.2, "step": 42, "cause": None}
    event = {"level": "WARN", "code": "contradiction", "text": "step 42: …", "about": about}
    yield "event", "event", event | {"src": "filter/box"}


def lines() -> Iterator[str]:
    """One line for each case, with the fields that the messages of this version have."""
    for name, topic, fields in cases():
        known = TYPES[topic].__struct_fields__
        plain = {field: value for field, value in (COMMON | fields).items() if field in known}
        payload = encode(decode(topic, msgpack.packb(plain)))
        kept = msgpack.unpackb(payload)
        yield json.dumps({"name": name, "topic": topic, "fields": kept, "payload": payload.hex()}, ensure_ascii=False)


if __name__ == "__main__":
    with Path(sys.argv[1]).open("x", encoding="utf-8") as file:
        file.writelines(f"{line}\n" for line in lines())

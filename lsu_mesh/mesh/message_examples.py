"""A message of every topic, for documentation and tests: ``python -m lsu_mesh.mesh.message_examples``."""

from __future__ import annotations

import math
import struct
from typing import Any

import msgspec

from lsu_mesh.mesh.bank_messages import BANK_TYPES, BankMessage
from lsu_mesh.mesh.messages import TYPES, VERSION, Bounds, Message, OrthotopeMessage, Rejection


def example(topic: str) -> Message:
    """A message of a topic, for documentation and tests."""
    common: dict[str, Any] = {
        "v": VERSION, "src": "filter/box", "boot": "0123456789abcdef", "seq": 41, "step": 42,
        "sent_ns": 1_700_000_000_020_000_000, "origin_ns": 1_700_000_000_018_000_000, "model": "b015983c54e6e4d2",
    }  # fmt: skip
    box = OrthotopeMessage(lower=[-0.25, 0.5], upper=[0.75, 1.0])
    bounds: dict[str, Any] = {"lower": box.lower, "upper": box.upper}
    estimate: dict[str, Any] = bounds | {
        "kind": "LSUO", "support": box, "point": [0.25, 0.75], "log_volume": -0.6931471805599453,
        "volume_of": "support", "status": "ok", "revision": 0, "epoch": 0, "guarantee": "declared",
        "base": ("posterior", "filter/box", "0123456789abcdef", 40),
        "used": [
            ("input", "plant/plant", "0011223344556677", 40),
            ("measurement", "sensor/s1", "8899aabbccddeeff", 41),
        ],
        "bounds": Bounds(rho=[0.1, 0.1], r=[0.3]), "missing": ["s2"], "point_rule": "mean", "algorithm": 1,
        "mean": [0.25, 0.8], "covariance": [[0.04, 0.01], [0.01, 0.02]],
    }  # fmt: skip
    own: dict[str, dict[str, Any]] = {
        "truth": {"x": [0.1, 0.8]},
        "input": {"u": [0.4], "time_ns": 1_700_000_000_000_000_000},
        "measurement": {"y": [0.7, None], "time_ns": 1_700_000_000_017_500_000, "time_error_ns": 500_000},
        "prediction": bounds
        | {
            "support": box,
            "y_lower": [-0.3],
            "y_upper": [1.1],
            "y_point": [0.4],
            "epoch": 0,
            "guarantee": "declared",
            "base": ("posterior", "filter/box", "0123456789abcdef", 40),
            "used": [("input", "plant/plant", "0011223344556677", 40)],
            "bounds": Bounds(rho=[0.1, 0.1], r=[0.3]),
            "algorithm": 1,
            "point_rule": "mean",
        },
        "posterior": estimate,
        "smoothed": bounds
        | {
            "support": box,
            "lag": 5,
            "base": ("posterior", "filter/box", "0123456789abcdef", 46),
            "revision": 0,
            "epoch": 0,
            "guarantee": "declared",
            "algorithm": 1,
        },
        "fused": estimate
        | {
            "mean": None,
            "covariance": None,
            "policy": "relaxed",
            "faults": 1,
            "quarantined": [],
            "rejected": [Rejection(source="cz", reason="disjoint")],
        },
        "bounds": {
            "rho": [0.1, 0.1],
            "r": {"s1": [0.36]},
            "factor": 2.0,
            "margin": 1.2,
            "first": 1,
            "last": 42,
            "explained": False,
            "adopt_at": 62,
        },
        "health": {
            "role": "filter",
            "level": "OK",
            "reasons": [],
            "counters": {"received": 84.0, "gaps": 0.0},
            "started_ns": 1_699_999_999_000_000_000,
            "host": "lab-1",
        },
        "event": {
            "level": "WARN",
            "code": "contradiction",
            "text": "step 42: …",
            "about": {"sensor": "s1", "gap": 0.2},
        },
    }
    return TYPES[topic](**common, **own[topic])


def bank_example(topic: str) -> BankMessage:
    """A message of a bank of two instances, for documentation and tests."""
    common: dict[str, Any] = {
        "v": VERSION, "src": "filter/targets", "boot": "0123456789abcdef", "seq": 41, "step": 42, "instances": 2,
        "sent_ns": 1_700_000_000_020_000_000, "origin_ns": 1_700_000_000_018_000_000, "model": "b015983c54e6e4d2",
    }  # fmt: skip
    used = [("bank_measurement", "sensor/radar", "8899aabbccddeeff", 41)]
    sets: dict[str, Any] = {
        "lower": _packed(-0.25, 0.5, 3.0, 4.0), "upper": _packed(0.75, 1.0, 3.5, 4.5),
        "point": _packed(0.25, 0.75, 3.25, 4.25), "statuses": b"\x00\x01", "guarantee": "declared",
        "base": ("bank_posterior", "filter/targets", "0123456789abcdef", 40), "used": used, "missing": ["lidar"],
        "algorithm": 1,
    }  # fmt: skip
    own: dict[str, dict[str, Any]] = {
        "bank_truth": {"x": _packed(0.1, 0.8, 3.1, 4.2)},
        "bank_measurement": {"y": _packed(0.7, math.nan), "time_ns": 1_700_000_000_017_500_000, "time_error_ns": 0},
        "bank_posterior": sets
        | {
            "kind": "LSUO",
            "support": "orthotope",
            "log_volume": _packed(-0.6931471805599453, -1.3862943611198906),
            "volume_of": "support",
            "epoch": 0,
            "point_rule": "mean",
        },
        "bank_fused": sets | {"base": "sources", "policy": "intersect", "faults": 0},
    }
    return BANK_TYPES[topic](**common, **own[topic])


def _packed(*numbers: float) -> bytes:
    return struct.pack(f"<{len(numbers)}d", *numbers)


if __name__ == "__main__":
    for _topic in TYPES:
        print(f"{_topic}: {msgspec.json.encode(example(_topic)).decode()}")

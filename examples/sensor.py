"""A sensor in plain zenoh and msgpack: python sensor.py ENDPOINT MESH NAME

Each line of input is a number, or a list such as [1.5, null].
What it must do stands in docs/protocol.md: a new boot at each start, its time, and the digest that the mesh answers.
"""

import json
import secrets
import socket
import sys
import time

import msgpack
import zenoh

endpoint, mesh, name = sys.argv[1:4]
configuration = zenoh.Config()
for path, value in {
    "connect/endpoints": [endpoint], "connect/timeout_ms": -1, "listen/endpoints": ["tcp/127.0.0.1:0"],
    "scouting/multicast/enabled": False,
    "scouting/gossip/autoconnect_strategy": {"peer": {"to_router": "always", "to_peer": "always"}},
}.items():  # fmt: skip
    configuration.insert_json5(path, json.dumps(value))
boot, began, digest, asked = secrets.token_hex(8), time.time_ns(), "", 0.0
sent = {"measurement": 0, "health": 0}

with zenoh.open(configuration) as session:
    token = session.liveliness().declare_token(f"lsu/v1/{mesh}/live/{name}")

    def send(topic: str, fields: dict) -> None:
        now = time.time_ns()
        message = {"v": 1, "src": f"sensor/{name}", "boot": boot, "seq": sent[topic], "step": 0, "sent_ns": now,
                   "origin_ns": now, "model": digest}  # fmt: skip
        session.put(f"lsu/v1/{mesh}/{topic}/{name}", msgpack.packb(message | fields))
        sent[topic] += 1

    for line in sys.stdin:
        measured = time.time_ns()
        while not digest or time.monotonic() > asked + 1:  # once a second: a mesh that began anew has another digest
            for reply in session.get(f"lsu/v1/{mesh}/model", timeout=1.0):
                digest = msgpack.unpackb(reply.ok.payload.to_bytes())["model"] if reply.ok else digest
            asked = time.monotonic()
            if digest:
                counters = {"published": sent["measurement"]}
                health = {"role": "sensor", "level": "OK", "reasons": [], "counters": counters}
                send("health", health | {"started_ns": began, "host": socket.gethostname()})
        y = json.loads(line)
        send("measurement", {"y": y if isinstance(y, list) else [y], "time_ns": measured, "time_error_ns": 0})

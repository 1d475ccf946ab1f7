"""Print the fused bounds of a running mesh: python subscribe.py [endpoint] (needs only zenoh and msgpack)."""

import json
import sys

import msgpack
import zenoh

configuration = zenoh.Config()
configuration.insert_json5("mode", '"client"')
configuration.insert_json5("connect/endpoints", json.dumps([*sys.argv[1:2]] or ["tcp/127.0.0.1:7447"]))
with zenoh.open(configuration) as session, session.declare_subscriber("lsu/v1/*/fused/*") as fused:
    for sample in fused:
        message = msgpack.unpackb(sample.payload.to_bytes())
        bounds = zip(message["lower"], message["upper"], strict=True)
        print(
            f"step {message['step']:5d}  " + "  ".join(f"[{low:8.4f}, {high:8.4f}]" for low, high in bounds), flush=True
        )

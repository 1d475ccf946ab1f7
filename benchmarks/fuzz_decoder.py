"""Coverage-guided fuzzing of the decoder and of the nodes with Atheris (libFuzzer); ends at the first crash.

    pip install -c constraints.txt ".[fuzz]"
    python benchmarks/fuzz_decoder.py -max_total_time=60

Arguments are libFuzzer's. The first byte of an input chooses the topic, the rest is the payload.
"""

from __future__ import annotations

import sys
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["lsu_mesh.mesh"]):
    from lsu_mesh.mesh.config import load
    from lsu_mesh.mesh.keys import key
    from lsu_mesh.mesh.message_examples import example
    from lsu_mesh.mesh.messages import TYPES, Refused, decode, encode
    from lsu_mesh.mesh.nodes.filter import FilterNode
    from lsu_mesh.mesh.nodes.fusion import FusionNode
    from lsu_mesh.mesh.nodes.node import Node

TOPICS = tuple(TYPES)
CONFIGURATION = load(Path(__file__).resolve().parent.parent / "services" / "lsu_mesh_services" / "demo.toml")
NAMES = {"truth": "plant", "input": "plant", "measurement": "s1", "fused": "main"}


def fresh_nodes() -> list[Node]:
    """A filter and a fusion."""
    return [FilterNode(CONFIGURATION, "box", "a" * 16), FusionNode(CONFIGURATION, "main", "b" * 16)]


NODES = fresh_nodes()


def one_input(data: bytes) -> None:
    """Decode, encode again, and deliver; nothing but ``Refused`` may be raised."""
    topic, payload = TOPICS[data[0] % len(TOPICS)] if data else TOPICS[0], data[1:]
    try:
        message = decode(topic, payload)
    except Refused:
        return
    assert decode(topic, encode(message)) == message
    for node in NODES:
        node.deliver(key("demo", topic, NAMES.get(topic, "box")), payload, message.sent_ns)
        node.tick(message.sent_ns)


if __name__ == "__main__":
    corpus = Path(sys.argv[-1]) if len(sys.argv) > 1 and not sys.argv[-1].startswith("-") else None
    if corpus is not None:
        corpus.mkdir(parents=True, exist_ok=True)
        for number, name in enumerate(TOPICS):
            (corpus / name).write_bytes(bytes([number]) + encode(example(name)))
    atheris.Setup(sys.argv, one_input)
    atheris.Fuzz()

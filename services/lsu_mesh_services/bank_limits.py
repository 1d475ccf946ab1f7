"""Commands that know single targets only say so of a mesh of banks, and what to do instead."""

from __future__ import annotations

import sys

from lsu_mesh.mesh.config import Configuration

REMEDIES = {
    "replay": "use lsu-mesh replay FILE --verify, which recomputes every set of every target",
    "simulate": "leave out instances to simulate one target of the same model",
    "gateway": "read the bank with lsu_mesh_services.client",
    "identify": "take the data of one target into a file, and a configuration without instances",
}
"""What to do instead, by command."""


def refuses_bank(configuration: Configuration, command: str) -> bool:
    """Whether the mesh is one of banks, which the command does not know; then stderr is told."""
    if configuration.instances is None:
        return False
    count = configuration.instances.count
    text = f"its filters are banks of {count} targets, and lsu-mesh {command} knows single targets only"
    print(f"{configuration.path}: {text}; {REMEDIES[command]}", file=sys.stderr)
    return True

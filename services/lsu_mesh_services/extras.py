"""The extras of an installation: the packages that each brings, and what to install where one is missing.

Nothing of an extra is imported here: whether it is there is known before a command loads anything.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from typing import NamedTuple, TypeAlias


class Extra(NamedTuple):
    """An extra of ``pyproject.toml``."""

    name: str
    modules: Mapping[str, str]
    """Import name of each distribution, those of the extras it contains included."""

    def missing(self) -> list[str]:
        """The distributions that are not installed; empty where the extra is there."""
        return [distribution for distribution, module in self.modules.items() if find_spec(module) is None]

    @property
    def remedy(self) -> str:
        """The line that installs it."""
        return f'pip install "lsu-mesh[{self.name}]"'


MESH = Extra("mesh", {"eclipse-zenoh": "zenoh", "msgpack": "msgpack", "cryptography": "cryptography"})
RECORD = Extra("record", {**MESH.modules, "rerun-sdk": "rerun", "pyarrow": "pyarrow"})
ROS2 = Extra("ros2", {**MESH.modules, "rosbags": "rosbags", "xxhash": "xxhash"})
GATEWAY = Extra(
    "gateway",
    {**MESH.modules, "starlette": "starlette", "uvicorn": "uvicorn", "prometheus-client": "prometheus_client"},
)
MCAP = Extra("mcap", {**RECORD.modules, "mcap": "mcap"})
EXTRAS = (MESH, RECORD, ROS2, GATEWAY, MCAP)

Need: TypeAlias = Extra | Callable[[argparse.Namespace], Extra | None] | None
"""What a command says as ``extra``: the one it needs, how its options decide that, or None."""


def refusal(options: argparse.Namespace) -> str:
    """One line that says what to install before the command can run; "" where all that it needs is there."""
    need: Need = options.extra
    extra = need if need is None or isinstance(need, Extra) else need(options)
    missing = [] if extra is None else extra.missing()
    if extra is None or not missing:
        return ""
    verb = "is" if len(missing) == 1 else "are"
    return f"{options.command}: {', '.join(missing)} {verb} not installed: {extra.remedy}"

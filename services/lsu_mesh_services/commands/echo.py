"""``lsu-mesh echo TOPIC/NAME``: the decoded messages of a topic, as they arrive."""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.json_form import plain
from lsu_mesh_services.exit_codes import NOT_MET, OK, USAGE
from lsu_mesh_services.monitoring.subscriber import Heard, run_tool, watching
from lsu_mesh_services.network.addresses import read_address

DIGITS = 7
"""Of numbers for people; ``--json`` gives all."""
MAX_ITEMS = 8
"""Longer lists are cut for people."""


class NoField(Exception):
    """A message has no such field; the text names those that it has."""


def main(options: argparse.Namespace) -> int:
    return run_tool(options, _echo)


def _echo(configuration: Configuration, options: argparse.Namespace) -> int:
    addresses = read_address(configuration, options.address)
    printed, refused = 0, 0
    with watching(configuration, options) as watch:
        watch.listen(addresses)
        for heard in watch.received(options.timeout):
            if watch.admission.refused.total() > refused:
                refused = watch.admission.refused.total()
                print(f"refused: {watch.admission.last_refusal}", file=sys.stderr)
            if heard is None or heard.message is None:
                continue
            try:
                _print(heard, options)
            except NoField as error:
                print(error, file=sys.stderr)
                return USAGE
            printed += 1
            if printed == options.count:
                return OK
    if options.stop or options.timeout is None or (printed and options.count is None):
        return OK
    print(f"{printed} message(s) of {options.address} within {options.timeout:g} s", file=sys.stderr)
    return NOT_MET


def _print(heard: Heard, options: argparse.Namespace) -> None:
    assert heard.message is not None
    content: dict[str, Any] = plain(heard.message)
    chosen = content if options.field is None else field_of(content, options.field)
    if options.json:
        about = {"topic": heard.topic, "name": heard.name, "arrival_ns": heard.arrival_ns}
        rest = {"message": content} if options.field is None else {"step": content["step"], options.field: chosen}
        print(json.dumps(about | rest), flush=True)
    elif options.field is not None:
        print(shown(chosen), flush=True)
    else:
        latency_ms = (heard.arrival_ns - content["sent_ns"]) * 1e-6
        words = f"step {content['step']}, {heard.size} bytes, {latency_ms:.2f} ms after sending"
        print(f"--- {heard.topic}/{heard.name}: {words}")
        for name, entry in content.items():
            print(f"{name}: {shown(entry)}")
        sys.stdout.flush()


def field_of(content: dict[str, Any], path: str) -> Any:
    """The value at ``path``: names and places in lists, joined by dots."""
    value: Any = content
    for i, part in enumerate(path.split(".")):
        before = ".".join(path.split(".")[:i])
        if isinstance(value, dict) and part in value:
            value = value[part]
        elif isinstance(value, list) and part.lstrip("-").isdigit() and -len(value) <= int(part) < len(value):
            value = value[int(part)]
        else:
            there = ", ".join(value) if isinstance(value, dict) else f"a {type(value).__name__}"
            if isinstance(value, list):
                there = f"{len(value)} items, counted from 0"
            raise NoField(f"no field {path!r}: {before or 'the message'} has {there}")
    return value


def shown(value: object) -> str:
    """A value for people, in one line."""
    if isinstance(value, float):
        return f"{value:.{DIGITS}g}"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name}: {shown(one)}" for name, one in value.items()) + "}"
    if isinstance(value, list | tuple):
        rest = f", … {len(value)} in all" if len(value) > MAX_ITEMS else ""
        return "[" + ", ".join(shown(one) for one in value[:MAX_ITEMS]) + rest + "]"
    return "nil" if value is None else str(value)

"""``lsu-mesh publish NAME``: what a program prints is what a sensor measures."""

from __future__ import annotations

import argparse
import os
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from lsu_mesh_services.client import Mesh, MeshError, NotAllowed, Settings, Source, Stream, WrongValue
from lsu_mesh_services.exit_codes import COULD_NOT_START, FAILURE, OK, USAGE
from lsu_mesh_services.published_lines import LineReader, Reading

MAX_WAITING = 65536
"""Lines that may wait for the mesh; of more the newest are kept."""
MAX_AGE_S = 5.0
"""Lines that came so long before the mesh are dropped: it would refuse them as of the past."""
STAY_S = 1.0
"""A program that prints one line and ends stays so long, so that every filter gets it."""


TOLD = 10
"""So many wrong lines are told each; of later ones one a second, with the number of those between."""


class Line(NamedTuple):
    """A line, and when it came."""

    number: int
    text: str
    time_ns: int


class WrongLines:
    """Tells of wrong lines: a program that prints nothing else must not hide all that is said besides."""

    def __init__(self) -> None:
        self.count = self._untold = 0
        self._told_at = 0.0

    def tell(self, line: Line, error: WrongValue) -> None:
        """One more."""
        self.count += 1
        if self.count > TOLD and time.monotonic() < self._told_at + 1.0:
            self._untold += 1
            return
        before = f" ({self._untold} wrong line(s) before it are not shown)" if self._untold else ""
        print(f"publish: line {line.number}: {error}{before}", file=sys.stderr)
        self._untold, self._told_at = 0, time.monotonic()


def main(options: argparse.Namespace) -> int:
    settings = _settings(options)
    if settings is None:
        return USAGE
    lines: Stream[Line] = Stream(MAX_WAITING)
    threading.Thread(target=_read, args=(lines,), daemon=True).start()
    try:
        with Mesh(settings) as mesh:
            return _publish(mesh, lines, options)
    except (NotAllowed, WrongValue) as error:
        print(f"publish: {error}", file=sys.stderr)
        return USAGE
    except MeshError as error:
        print(f"publish: {error}", file=sys.stderr)
        return COULD_NOT_START


def _settings(options: argparse.Namespace) -> Settings | None:
    """From the file alone, so that a small host need not load what reads and checks all of it; or with overrides."""
    path = Path(__file__).resolve().parent.parent / "demo.toml" if options.config is None else Path(options.config)
    try:
        if options.overrides or any(name.startswith("LSU_MESH_") for name in os.environ):
            from lsu_mesh_services.configuration import load_or_explain

            configuration = load_or_explain(options.config, options, makes_filters=False)
            if configuration is None:
                return None
            settings = Settings.of(configuration.values, path.parent)
        else:
            settings = Settings.read(path)
        _check_listen(options)
    except MeshError as error:
        print(f"publish: {error}", file=sys.stderr)
        return None
    return replace(
        settings, connect=options.connect or settings.connect, listen=options.listen, mode=options.mode or "peer",
        zenoh=options.cfg, wait=None, tell=lambda words: print(f"publish: {words}", file=sys.stderr),
    )  # fmt: skip


def _check_listen(options: argparse.Namespace) -> None:
    if options.listen or options.cfg:
        from lsu_mesh_services.network.security import InsecureSession, check_endpoints

        try:
            check_endpoints(options.listen, options.cfg, insecure=options.insecure)
        except InsecureSession as error:
            raise MeshError(str(error)) from None


def _read(lines: Stream[Line]) -> None:
    """Take each line when it comes: that is its time, where it names none, however long the mesh lets wait."""
    for number, text in enumerate(sys.stdin, 1):
        lines.put(Line(number, text, time.time_ns()))
    lines.close()


def _publish(mesh: Mesh, lines: Stream[Line], options: argparse.Namespace) -> int:
    wrong, sent = WrongLines(), 0
    is_plant = options.plant or options.name == mesh.model().plant
    source = mesh.plant(options.name) if is_plant else mesh.sensor(options.name)
    print(f"publish: {source.role} {options.name} is on the mesh {mesh.name!r}", file=sys.stderr)
    began, oldest_ns, dropped = time.monotonic(), time.time_ns() - int(MAX_AGE_S * 1e9), 0
    reader = LineReader("u" if is_plant else "y")
    try:
        for line in lines:
            if line.time_ns < oldest_ns:
                dropped += 1
                continue
            try:
                for reading in reader.readings(line.text, source.outputs):
                    _send(source, reading, line)
                    sent += 1
            except WrongValue as error:
                wrong.tell(line, error)
        time.sleep(max(0.0, began + STAY_S - time.monotonic()) if sent else 0.0)
    except KeyboardInterrupt:
        pass  # the usual way to end it
    if dropped := dropped + lines.dropped:
        print(f"publish: {dropped} line(s) came long before the mesh, and were dropped", file=sys.stderr)
    print(f"publish: {sent} sent" + (f", {wrong.count} line(s) not: see above" if wrong.count else ""), file=sys.stderr)
    return FAILURE if wrong.count or dropped else OK


def _send(source: Source, reading: Reading, line: Line) -> None:
    more = dict(reading.more)
    if reading.time is None and "time_ns" not in more:
        more["time_ns"] = line.time_ns
    source.publish(reading.values, "now" if reading.time is None else reading.time, **more)

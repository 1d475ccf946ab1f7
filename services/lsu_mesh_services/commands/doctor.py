"""``lsu-mesh doctor``: whether this machine can run the mesh of a configuration, and the remedy where it cannot."""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import re
import resource
import shutil
import socket
import statistics
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, NamedTuple

from lsu_mesh.mesh.config import Configuration
from lsu_mesh_services.configuration import load_or_explain
from lsu_mesh_services.exit_codes import NOT_MET, OK, USAGE
from lsu_mesh_services.extras import EXTRAS, GATEWAY, MCAP, MESH, RECORD, ROS2, Extra
from lsu_mesh_services.network.security import missing_files

Level = Literal["ok", "warn", "fail"]
MIN_PYTHON = (3, 11)
NEEDED = ("numpy", "scipy", "numba", "msgspec", "rich")
CONSTRAINTS = Path(__file__).resolve().parents[3] / "constraints.txt"
WITHOUT: dict[str, tuple[Level, str]] = {
    MESH.name: ("fail", "no peer can start here"),
    RECORD.name: ("warn", "a run is not recorded, recordings cannot be read"),
    ROS2.name: ("warn", "no sensor can listen to ROS 2, bags cannot be imported"),
    GATEWAY.name: ("warn", "no page, and no HTTP for browsers and curl"),
    MCAP.name: ("warn", "recordings cannot be exported as MCAP"),
}
"""What a missing extra means."""
ENOUGH_FILES, MIN_FILES = 1024, 256
ENOUGH_DISK, LEAST_DISK = 2**30, 100 * 2**20
PEER_MEMORY = 200 * 2**20
"""A peer with its kernels; a recorder needs twice that."""
LATE_WAKEUP_MS, DRIFT_MS = 5.0, 1.0
STYLES = {"ok": "green", "warn": "yellow", "fail": "red"}


class Check(NamedTuple):
    """What was looked at, how it is, and what to do about it (empty where it is well)."""

    what: str
    level: Level
    words: str
    remedy: str = ""


def main(options: argparse.Namespace) -> int:
    configuration = load_or_explain(options.config, options)
    if configuration is None:
        return USAGE
    found = list(checks(configuration))
    if options.json:
        for check in found:
            print(json.dumps(check._asdict()))
    else:
        _print(found)
    return NOT_MET if any(check.level == "fail" for check in found) else OK


def _print(found: list[Check]) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 140, highlight=False)
    table = Table(box=None, pad_edge=False, show_header=False)
    for check in found:
        style = STYLES[check.level]
        words = f"{check.words}; {check.remedy}" if check.remedy else check.words
        table.add_row(f"[{style}]{check.level}[/]", check.what, escape(words))
    console.print(table)


def checks(configuration: Configuration) -> Iterator[Check]:
    """Everything that is looked at, in turn."""
    yield python_version(sys.version_info[:3])
    yield from packages(_pinned())
    yield from (extra_installed(extra) for extra in EXTRAS)
    yield kernels()
    yield entry_port(configuration.network.entry)
    yield from certificates(configuration)
    yield open_files(*resource.getrlimit(resource.RLIMIT_NOFILE))
    yield clock()
    yield disk(Path(configuration.recorder.path.replace("{mesh}", "x").replace("{time}", "x")).parent)
    yield memory(_available_memory(), len(configuration.peers()) + 1)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    yield load(os.getloadavg()[0], cores)
    yield viewer(Path(sys.executable).with_name("rerun"), os.environ)


def python_version(version: tuple[int, ...]) -> Check:
    """At least the oldest that is tested."""
    words = ".".join(str(part) for part in version)
    if version[:2] >= MIN_PYTHON:
        return Check("Python", "ok", words)
    return Check("Python", "fail", words, "lsu-mesh needs 3.11 or newer: make setup PYTHON=python3.12")


def _pinned() -> dict[str, str]:
    """Versions that are tested together, where this is a checkout."""
    if not CONSTRAINTS.is_file():
        return {}
    pins = re.findall(r"^([\w.-]+)==(\S+)$", CONSTRAINTS.read_text(encoding="utf-8"), re.MULTILINE)
    return dict(pins)


def packages(pinned: dict[str, str]) -> Iterator[Check]:
    """Whether the base is installed, and all that is installed is in the tested versions."""
    others = []
    for name in dict.fromkeys([*NEEDED, *(name for extra in EXTRAS for name in extra.modules)]):
        try:
            version = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            if name in NEEDED:
                yield Check("packages", "fail", f"{name} is not installed", "make setup, or pip install lsu-mesh")
            continue
        if version != pinned.get(name, version):
            others.append(f"{name} {version} (tested: {pinned[name]})")
    if others:
        yield Check("packages", "warn", ", ".join(others), "pip install -c constraints.txt brings the tested versions")
    else:
        yield Check("packages", "ok", "all in the tested versions" if pinned else "all there")


def extra_installed(extra: Extra) -> Check:
    """Whether an extra is there, and what works without it."""
    what, missing = f"extra {extra.name}", extra.missing()
    if not missing:
        return Check(what, "ok", ", ".join(extra.modules))
    level, words = WITHOUT[extra.name]
    return Check(what, level, f"{', '.join(missing)} not installed: {words}", extra.remedy)


def kernels() -> Check:
    """Whether the first peers would have to compile."""
    from lsu_mesh.kernels import filter_step
    from lsu_mesh.kernels.linear_programs import safe_maxima
    from lsu_mesh.kernels.runtime.compile import awaits_compilation

    if not (awaits_compilation(filter_step.advance) or awaits_compilation(safe_maxima.maxima)):
        return Check("kernels", "ok", "compiled and cached")
    remedy = "python -m lsu_mesh.filters.warm_up does it once"
    return Check("kernels", "warn", "not compiled yet: the first run takes a minute or two longer", remedy)


def entry_port(entry: str) -> Check:
    """Whether the first peer can listen there."""
    place = re.fullmatch(r"\w+/(?:\[([^\]]+)\]|([^:/]+)):(\d+)", entry.partition("?")[0].partition("#")[0])
    if place is None:
        return Check("entry", "warn", f"{entry} is no HOST:PORT", "it is not looked at here")
    host, port = place[1] or place[2], int(place[3])
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # one that was just closed counts as free
            probe.bind(address)
    except OSError as error:
        words = f"{entry}: {error.strerror or error}"
        remedy = "a mesh may be running (lsu-mesh list); else choose another: -X network.entry=tcp/127.0.0.1:PORT"
        return Check("entry", "warn", words, remedy)
    return Check("entry", "ok", f"{entry} is free")


def certificates(configuration: Configuration) -> Iterator[Check]:
    """The files of mutual TLS, where it is enabled."""
    if configuration.network.tls.enabled:
        missing = missing_files(configuration)
        if missing:
            yield Check(
                "certificates",
                "fail",
                "; ".join(one.sentence for one in missing),
                f"lsu-mesh keys init {configuration.path}",
            )
        else:
            yield Check("certificates", "ok", "all there")


def open_files(soft: int, hard: int) -> Check:
    """Each link of each peer is a file."""
    if soft == resource.RLIM_INFINITY or soft >= ENOUGH_FILES:
        return Check("open files", "ok", "no limit" if soft == resource.RLIM_INFINITY else f"{soft} a process")
    remedy = f"ulimit -n {ENOUGH_FILES}"
    return Check("open files", "warn" if soft >= MIN_FILES else "fail", f"only {soft} a process", remedy)


def clock() -> Check:
    """Whether sleeps end in time, and the wall clock goes as the monotonic one does."""
    before, late = time.time_ns() - time.monotonic_ns(), []
    for _ in range(50):
        began = time.perf_counter()
        time.sleep(0.002)
        late.append((time.perf_counter() - began - 0.002) * 1e3)
    drift = (time.time_ns() - time.monotonic_ns() - before) * 1e-6
    median, worst = statistics.median(late), max(late)
    words = f"sleeps end {median:.2f} ms late (worst of 50: {worst:.1f} ms)"
    if abs(drift) > DRIFT_MS:
        remedy = "latencies between hosts are wrong while it is being set; times of steps are not"
        return Check("clock", "warn", f"the wall clock was moved by {drift:.1f} ms in 0.1 s", remedy)
    if median > LATE_WAKEUP_MS:
        return Check("clock", "warn", words, "something else takes the processor; latencies will be long")
    return Check("clock", "ok", words)


def disk(folder: Path) -> Check:
    """Room for recordings."""
    there = next(place for place in (folder, *folder.parents, Path()) if place.exists())
    if not os.access(there, os.W_OK):
        return Check("disk", "fail", f"{there.resolve()} cannot be written", "run --record FILE elsewhere")
    free = shutil.disk_usage(there).free
    words = f"{free / 2**30:.1f} GiB free for {folder}/"
    if free >= ENOUGH_DISK:
        return Check("disk", "ok", words)
    return Check("disk", "warn" if free >= LEAST_DISK else "fail", words, "make room, or run --record FILE elsewhere")


def _available_memory() -> int | None:
    try:
        found = re.search(r"MemAvailable:\s+(\d+) kB", Path("/proc/meminfo").read_text(encoding="ascii"))
    except OSError:
        return None
    return None if found is None else int(found[1]) * 1024


def memory(available: int | None, peers: int) -> Check:
    """Room for all peers of the configuration on this one machine."""
    if available is None:
        return Check("memory", "warn", "not known on this system")
    words = f"{available / 2**30:.1f} GiB for {peers} processes"
    if available >= peers * PEER_MEMORY:
        return Check("memory", "ok", words)
    return Check("memory", "warn", words, "run fewer peers here, and others elsewhere with `lsu-mesh filter NAME -e …`")


def load(average: float, cores: int) -> Check:
    """Whether others leave the peers a processor."""
    words = f"{cores} processor{'s' if cores > 1 else ''}, load {average:.1f}"
    if average <= cores:
        return Check("load", "ok", words)
    return Check("load", "warn", words, "peers will be late: deadlines pass and steps count as behind")


def viewer(program: Path, environment: os._Environ[str] | dict[str, str]) -> Check:
    """Whether recordings can be looked at here."""
    if not program.exists():
        return Check("viewer", "warn", f"no {program}", f"{RECORD.remedy}; the mesh runs without it")
    if not (environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")) and sys.platform == "linux":
        return Check("viewer", "warn", "found, but there is no display", "lsu-mesh run --web serves it to a browser")
    return Check("viewer", "ok", str(program))

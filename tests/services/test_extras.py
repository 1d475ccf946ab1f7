"""What works without the extras, and what a command says when its own is not installed."""

from __future__ import annotations

import argparse
import os
import re
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from lsu_mesh_services import extras
from lsu_mesh_services.cli import build_parser, main
from lsu_mesh_services.exit_codes import COULD_NOT_START, NOT_MET, OK
from lsu_mesh_services.extras import GATEWAY, MCAP, MESH, RECORD, ROS2, Extra
from without_modules import without

FILE = "x.rrd"
NEEDS = (
    (MESH, (
        "run --no-record", "run", "plant", "sensor s1", "filter cz", "fusion main", "identifier x", "router", "list",
        "echo posterior", "hz posterior", "top", "publish gauge", "health", "graph --live", "keys init m.toml",
        "bench mesh", "bench start", "bench scale",
    )),
    (RECORD, (
        f"run --record {FILE}", "run --view", "run --web", "recorder", f"view {FILE}", f"replay {FILE}",
        f"replay {FILE} --live", f"replay {FILE} --verify", f"recording info {FILE}", f"recording repair {FILE}",
        f"recording merge {FILE}", f"recording export {FILE} --format parquet", f"identify m.toml --recording {FILE}",
        "bench recording", "bench mesh --recorder", "bench start --recorder",
    )),
    (ROS2, ("import drive.mcap", "bridge ros2")),
    (GATEWAY, ("gateway", "gateway --http 127.0.0.1:0")),
    (MCAP, (f"recording export {FILE} --format mcap",)),
)  # fmt: skip
NONE = (
    "validate m.toml",
    "simulate",
    "identify m.toml",
    "doctor",
    "graph",
    "reproduce p2006",
    "bench kernels",
    "bench compare a.json b.json",
    "bench throughput",
    "bench scale --no-processes",
    "new m.toml",
)
SENSOR = """
[mesh]
name = "files"
dt = 1.0
[model]
A = [[0.9]]
rho = [0.1]
[model.prior]
lower = [-1.0]
upper = [1.0]
[sensors.s]
C = [[1.0]]
r = [0.1]
file = "s.csv"
columns = ["y"]
step = "step"
"""


def leaves(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """All commands."""
    inner = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    if not inner:
        yield parser
    for action in inner:
        for command in action.choices.values():
            yield from leaves(command) if command.get_default("handler") is None else [command]


def test_every_command_is_looked_at_here() -> None:
    commands = {parser.prog.split()[1] for parser in leaves(build_parser())}
    assert commands == {line.split()[0] for lines in (*(lines for _, lines in NEEDS), NONE) for line in lines}


@pytest.mark.parametrize(("extra", "line"), [(extra, line) for extra, lines in NEEDS for line in lines])
def test_a_command_without_its_extra_says_in_one_line_what_to_install(
    extra: Extra, line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(extras, "find_spec", lambda module: None)
    assert main(line.split()) == COULD_NOT_START
    out, err = capsys.readouterr()
    assert out == ""
    command, *_ = line.split()
    names = ", ".join(extra.modules)
    assert err == f'{command}: {names} are not installed: pip install "lsu-mesh[{extra.name}]"\n'


def test_only_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "find_spec", lambda module: None if module == "rerun" else module)
    options = build_parser().parse_args(["view", FILE])
    assert extras.refusal(options) == 'view: rerun-sdk is not installed: pip install "lsu-mesh[record]"'
    assert extras.refusal(build_parser().parse_args(["run"])) == ""


@pytest.mark.parametrize("line", NONE)
def test_what_needs_no_extra_says_so(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "find_spec", lambda module: None)
    assert extras.refusal(build_parser().parse_args(line.split())) == ""


@pytest.fixture
def bare(lsu_mesh_command: list[str], tmp_path: Path) -> object:
    """Runs a command where no module of an extra can be imported."""
    folder = without([*RECORD.modules.values(), *ROS2.modules.values()], tmp_path / "blocked")
    paths = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]).strip(os.pathsep)

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        command: Sequence[str] = [*lsu_mesh_command, *arguments]
        environment = {**os.environ, "PYTHONPATH": paths}
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)

    return run


def test_the_base_install_validates_simulates_identifies_draws_and_diagnoses(bare, demo: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "s.csv").write_text("step,y\n" + "".join(f"{k},{0.05 * (k % 3)}\n" for k in range(1, 40)))
    (tmp_path / "m.toml").write_text(SENSOR)
    for arguments in (
        ("--help",), ("recording", "export", "--help"), ("validate", str(demo)), ("graph",),
        ("simulate", "--seeds", "6", "--steps", "10", "--workers", "2"), ("identify", "m.toml"),
    ):  # fmt: skip
        done = bare(*arguments)
        assert done.returncode == OK, (arguments, done.stderr)
    done = bare("doctor")
    assert done.returncode == NOT_MET, done.stderr
    assert re.search(r"^ok    packages ", done.stdout, re.MULTILINE), done.stdout
    assert re.search(r'^fail  extra mesh .*pip install "lsu-mesh\[mesh\]" *$', done.stdout, re.MULTILINE), done.stdout
    assert re.search(r'^warn  extra record .*"lsu-mesh\[record\]" *$', done.stdout, re.MULTILINE | re.DOTALL), (
        done.stdout
    )


def test_a_command_of_a_base_install_ends_before_it_imports_anything(bare) -> None:  # type: ignore[no-untyped-def]
    for arguments, extra in ((("run",), MESH), (("list",), MESH), (("replay", FILE), RECORD)):
        done = bare(*arguments)
        assert done.returncode == COULD_NOT_START, done.stderr
        assert len(done.stderr.splitlines()) == 1
        assert done.stderr.endswith(f'pip install "lsu-mesh[{extra.name}]"\n')

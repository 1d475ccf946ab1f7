"""Each walk of ``CONTRIBUTING.md`` is performed in a copy of the tree: its files, its changes, its commands."""

from __future__ import annotations

import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import NamedTuple

import pytest

COPIED = ("lsu_mesh", "services", "tests", "docs", "examples", "pyproject.toml", "README.md", "CONTRIBUTING.md")
NEEDS = {"Add a filter": "lsu_mesh.testing", "Add a fusion policy": "lsu_mesh.fusion.policies"}
"""Walks that need a module, which not every copy of the tree has."""
_BLOCK = re.compile(r"^( *)```(\w+)(?: (\S+))?\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """A fenced block: its language, the file that it names, its text."""

    language: str
    file: str
    text: str


def walks(page: Path) -> dict[str, list[Block]]:
    """The blocks of each section whose title begins with "Add"."""
    found = {}
    for section in page.read_text(encoding="utf-8").split("\n## ")[1:]:
        title, _, text = section.partition("\n")
        found[title] = [Block(kind, file, textwrap.dedent(body)) for _, kind, file, body in _BLOCK.findall(text)]
    return {title: blocks for title, blocks in found.items() if title.startswith("Add ")}


def changed(before: str, diff: str) -> str:
    """A text after a change: lines with "-" go, lines with "+" come, the others stand in both."""
    lines = diff.splitlines(keepends=True)
    old = "".join(line[1:] for line in lines if line[0] != "+")
    new = "".join(line[1:] for line in lines if line[0] != "-")
    assert before.count(old) == 1, f"stands {before.count(old)} times in the file:\n{old}"
    return before.replace(old, new)


def perform(block: Block, tree: Path) -> None:
    """Write the file of a block, change it, or run the commands."""
    path = tree / block.file
    if block.language == "console":
        for line in block.text.splitlines():
            run(line, tree)
    elif block.language == "diff":
        path.write_text(changed(path.read_text(encoding="utf-8"), block.text), encoding="utf-8")
    else:
        assert not path.exists(), f"{block.file} is there already"
        path.write_text(block.text, encoding="utf-8")


def run(line: str, tree: Path) -> None:
    """Run a command with the copy's code."""
    words = shlex.split(line)
    programs = {"python": [sys.executable, "-P"], "lsu-mesh": [sys.executable, "-P", "-m", "lsu_mesh_services"]}
    command = [*programs[words[0]], *words[1:]]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join((str(tree), str(tree / "services")))}
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, timeout=500, check=False)
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"


@pytest.fixture
def tree(root: Path, tmp_path: Path) -> Path:
    """A copy of what the walks need, with the machine code of the kernels."""
    for name in COPIED:
        if (root / name).is_dir():
            shutil.copytree(root / name, tmp_path / name)
        else:
            shutil.copy(root / name, tmp_path / name)
    return tmp_path


TITLES = ("Add a filter", "Add a message field", "Add a command", "Add a fusion policy")


@pytest.mark.timeout(600)
@pytest.mark.parametrize("title", TITLES)
def test_a_walk_leads_where_it_says(root: Path, tree: Path, title: str) -> None:
    needed = NEEDS.get(title)
    if needed is not None and importlib.util.find_spec(needed) is None:
        pytest.skip(f"{needed} is not there")
    blocks = walks(root / "CONTRIBUTING.md")[title]
    for block in blocks:
        perform(block, tree)
    written = [str(tree / block.file) for block in blocks if block.file.endswith(".py")]
    for check in (["check"], ["format", "--check"]):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *check, *written], cwd=tree, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout


def test_every_walk_of_the_page_is_performed_and_ends_with_commands(root: Path) -> None:
    found = walks(root / "CONTRIBUTING.md")
    assert tuple(found) == TITLES
    assert [blocks[-1].language for blocks in found.values()] == ["console"] * len(TITLES)


def test_a_change_needs_its_place() -> None:
    assert changed("a\nb\nc\n", " b\n+x\n c\n") == "a\nb\nx\nc\n"
    assert changed("a\nb\nc\n", "-b\n+x\n") == "a\nx\nc\n"
    with pytest.raises(AssertionError, match="stands 2 times"):
        changed("a\na\n", " a\n+b\n")

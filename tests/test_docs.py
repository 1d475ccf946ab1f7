"""What pages say that code prints, it prints: the Python blocks of a page are run one after the other."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path
from typing import Any

import pytest

PAGES = ("README.md", "docs/library.md")
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page: Path) -> list[tuple[str, str]]:
    """Language and text of each block, in order."""
    return _BLOCK.findall(page.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", PAGES)
def test_python_blocks_run_and_print_what_the_page_shows(root: Path, name: str) -> None:
    found = blocks(root / name)
    names: dict[str, Any] = {}
    count = 0
    for i, (language, text) in enumerate(found):
        if language != "python":
            continue
        count += 1
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            exec(compile(text, f"{name}, block {count}", "exec"), names)
        if said.getvalue():
            assert found[i + 1] == ("text", said.getvalue()), f"{name}: what block {count} prints"
    assert count

"""The example of the library runs, and its filters hold the truth."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def test_every_filter_of_the_example_holds_the_truth(root: Path, tmp_path: Path) -> None:
    command = [sys.executable, str(root / "examples" / "library.py")]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    rows = [line.split() for line in result.stdout.splitlines() if line.startswith("LSU")]
    assert [row[0] for row in rows] == ["LSUO", "LSUP", "LSUPB", "LSUCZ"]
    assert [row[1] for row in rows] == ["100.0%"] * 4
    assert result.stderr == ""
    assert "fused at the last step" in result.stdout

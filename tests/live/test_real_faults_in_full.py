"""Every real fault at every role, and a long run, with the limits on time that an idle machine keeps."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.live, pytest.mark.soak, pytest.mark.timeout(3600)]


@pytest.mark.parametrize(
    "arguments", [["--strict"], ["--soak", "10", "--rate", "500"]], ids=["every fault at every role", "ten minutes"]
)
def test_nothing_breaks(root: Path, arguments: list[str]) -> None:
    command = [sys.executable, str(root / "benchmarks" / "faults.py"), *arguments]
    result = subprocess.run(command, cwd=root, text=True, capture_output=True, check=False)
    print(result.stdout)
    assert result.returncode == 0, result.stdout + result.stderr

"""What is committed is the project's own and holds no trace of a machine."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

MACHINE = re.compile(r"(^|[^\w./-])/(work|farm|root|home)/\w", re.MULTILINE)
REGISTRY = re.compile(r"https?://[^ )\"]*/simple|files\.pythonhosted|registry\.npmjs")


@pytest.fixture(scope="module")
def tracked(root: Path) -> list[Path]:
    try:
        listed = subprocess.run(["git", "ls-files"], cwd=root, capture_output=True, text=True, check=True).stdout
    except (FileNotFoundError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    return [root / name for name in listed.splitlines() if (root / name).is_file()]


def texts(tracked: list[Path]) -> list[tuple[Path, str]]:
    return [(path, path.read_text(encoding="utf-8")) for path in tracked if path.suffix not in (".png", ".xz")]


def test_no_file_holds_a_path_of_a_machine_or_the_address_of_a_registry(tracked: list[Path]) -> None:
    own = Path(__file__).name
    guilty = [
        path for path, text in texts(tracked) if path.name != own and (MACHINE.search(text) or REGISTRY.search(text))
    ]
    assert guilty == []


def test_the_constraints_hold_names_and_versions_only(root: Path) -> None:
    lines = [line for line in (root / "constraints.txt").read_text().splitlines() if line and not line.startswith("#")]
    assert lines
    assert [line for line in lines if not re.fullmatch(r"[A-Za-z0-9_.-]+==[A-Za-z0-9.]+", line)] == []


def test_every_make_command_that_the_readme_names_exists(root: Path) -> None:
    makefile = (root / "Makefile").read_text()
    for page in [root / "README.md", *sorted((root / "docs").glob("*.md"))]:
        for target in re.findall(r"`?make ([a-z-]+)", page.read_text()):
            if page.name == "README.md" or f"make {target}`" in page.read_text():
                assert re.search(rf"^{target}:", makefile, re.MULTILINE), f"{page.name}: make {target}"


def test_every_link_of_the_pages_leads_somewhere(root: Path) -> None:
    pages = [*(root / "docs").rglob("*.md"), *(root / "examples").rglob("*.md")]
    for page in [root / "README.md", root / "CHANGELOG.md", root / "CONTRIBUTING.md", *sorted(pages)]:
        for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
            if not target.startswith("http"):
                assert (page.parent / target).exists(), f"{page.name}: {target}"


MAX_LINES = 400
MAY_BE_LONGER = {"lsu_mesh/mesh/messages.py", "services/lsu_mesh_services/client.py"}
"""All messages of the protocol stand side by side; the client is one file, so that it can be copied."""


PLACES = ("", "lsu_mesh", "services/lsu_mesh_services")
"""Where the paths of the pages begin."""
_PATH = re.compile(r"`((?:[\w.-]+/)+(?:[\w.-]+\.(?:py|toml|md|yaml|sh))?)`")


def test_every_path_that_a_page_or_a_docstring_names_exists(root: Path) -> None:
    pages = [root / "README.md", root / "CONTRIBUTING.md", *sorted((root / "docs").rglob("*.md"))]
    files = [path for folder in ("lsu_mesh", "services") for path in sorted((root / folder).rglob("*.py"))]
    named = {(page.name, path) for page in pages for path in _PATH.findall(page.read_text(encoding="utf-8"))}
    named |= {
        (file.name, path)
        for file in files
        for path in _PATH.findall(file.read_text(encoding="utf-8"))
        if path.endswith(".py")
    }
    assert ("architecture.md", "kernels/parallelotopes/strip_update.py") in named
    assert [path for path in sorted(named) if not any((root / place / path[1]).exists() for place in PLACES)] == []


def test_no_python_file_grows_past_what_one_can_read(tracked: list[Path], root: Path) -> None:
    long = {
        path.relative_to(root).as_posix(): len(text.splitlines())
        for path, text in texts(tracked)
        if path.suffix == ".py" and len(text.splitlines()) > MAX_LINES
    }
    assert {name: lines for name, lines in long.items() if name not in MAY_BE_LONGER} == {}


def test_limits_are_named_alike(tracked: list[Path], root: Path) -> None:
    """``MAX_…``, as the rest of the code says."""
    other = re.compile(r"^(?:MOST|LARGEST|LONGEST|OLDEST)_[A-Z]\w*", re.MULTILINE)
    python = [(path, text) for path, text in texts(tracked) if path.suffix == ".py"]
    found = [f"{path.relative_to(root)}: {name}" for path, text in python for name in other.findall(text)]
    assert len(python) > 500
    assert found == []


MIRRORED = {"services": "services/lsu_mesh_services"}
"""Folders of tests that are named otherwise than what they test."""
NO_MIRROR = {"live", "docker", "examples", "data"}
"""Folders of tests of the whole, and of what tests read."""


def test_tests_mirror_the_tree(root: Path) -> None:
    tests = root / "tests"
    strays = []
    for folder in sorted({path.parent.relative_to(tests) for path in tests.rglob("test_*.py")}):
        first, *below = folder.parts or (".",)
        if first not in NO_MIRROR and not (root / MIRRORED.get(first, f"lsu_mesh/{first}")).joinpath(*below).is_dir():
            strays.append(f"tests/{folder}: {MIRRORED.get(first, 'lsu_mesh/' + first)} has no such folder")
    assert strays == []


def test_a_test_lies_where_the_file_lies_after_which_it_is_named(root: Path) -> None:
    tests = root / "tests"
    homes: dict[str, set[str]] = {}
    for base, mirror in ((root / "lsu_mesh", tests), (root / "services" / "lsu_mesh_services", tests / "services")):
        for path in base.rglob("*.py"):
            home = (mirror / path.parent.relative_to(base)).relative_to(tests)
            if path.stem == "__init__":
                homes.setdefault(path.parent.name, set()).update((home.as_posix(), home.parent.as_posix()))
            else:
                homes.setdefault(path.stem, set()).add(home.as_posix())
    misplaced = [
        f"tests/{folder}/{path.name}: expected in {sorted(homes[name])}"
        for path in sorted(tests.rglob("test_*.py"))
        if (folder := path.parent.relative_to(tests).as_posix()).split("/")[0] not in NO_MIRROR
        if (name := path.stem.removeprefix("test_")) in homes and folder not in homes[name]
    ]
    assert misplaced == []

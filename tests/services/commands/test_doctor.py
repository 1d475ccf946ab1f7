"""``lsu-mesh doctor`` sees what is wrong with a machine and says what to do."""

from __future__ import annotations

import json
import resource
import socket
from pathlib import Path

import pytest
from lsu_mesh_services.cli import main
from lsu_mesh_services.commands import doctor
from lsu_mesh_services.exit_codes import NOT_MET, OK


def test_this_machine_can_run_the_demo(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--json"]) == OK
    checks = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert {"Python", "packages", "kernels", "entry", "open files", "clock", "disk", "viewer"} <= {
        c["what"] for c in checks
    }
    assert all(check["level"] in ("ok", "warn") for check in checks), checks
    assert all(check["remedy"] for check in checks if check["level"] == "warn"), "each says what to do"


def test_a_check_that_fails_is_exit_code_4(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "NEEDED", ("numpy", "lsu-not-installed"))
    assert main(["doctor"]) == NOT_MET
    out = capsys.readouterr().out
    assert "fail  packages" in out
    assert "lsu-not-installed is not installed" in out


def test_a_port_that_is_taken_is_told() -> None:
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        port = holder.getsockname()[1]
        check = doctor.entry_port(f"tcp/127.0.0.1:{port}")
        assert check.level == "warn"
        assert "in use" in check.words
        assert "-X network.entry" in check.remedy
    assert doctor.entry_port(f"tls/127.0.0.1:{port}").level == "ok"


def test_old_pythons_other_versions_and_low_limits_are_told() -> None:
    assert doctor.python_version((3, 10, 4)).level == "fail"
    assert doctor.python_version((3, 13, 0)).level == "ok"
    (check,) = doctor.packages({"numpy": "0.1"})
    assert check.level == "warn"
    assert "(tested: 0.1)" in check.words
    assert doctor.open_files(1024, 4096).level == "ok"
    assert doctor.open_files(resource.RLIM_INFINITY, 4096).level == "ok"
    assert doctor.open_files(512, 4096).level == "warn"
    assert doctor.open_files(64, 4096) == ("open files", "fail", "only 64 a process", "ulimit -n 1024")


def test_little_room_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert doctor.disk(tmp_path / "runs").level == "ok"
    monkeypatch.setattr(doctor, "LEAST_DISK", 2**62)
    monkeypatch.setattr(doctor, "ENOUGH_DISK", 2**63)
    assert doctor.disk(tmp_path / "runs").level == "fail"
    assert doctor.memory(10**9, 10).level == "warn"
    assert doctor.memory(10**10, 10).level == "ok"
    assert doctor.load(9.0, 2).level == "warn"
    assert doctor.load(0.5, 2).level == "ok"


def test_a_missing_viewer_or_display_is_told(tmp_path: Path) -> None:
    program = tmp_path / "rerun"
    assert "the mesh runs without it" in doctor.viewer(program, {}).remedy
    program.touch()
    assert "--web" in doctor.viewer(program, {}).remedy
    assert doctor.viewer(program, {"DISPLAY": ":0"}).level == "ok"

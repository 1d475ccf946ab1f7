"""``lsu-mesh keys init`` and the refusals around certificates."""

from __future__ import annotations

import shutil
import stat
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import NameOID
from lsu_mesh_services.cli import main
from lsu_mesh_services.network.security import InsecureSession, certificates

from lsu_mesh.mesh.config import load

PEERS = {"recorder", "main", "box", "cz", "para", "s1", "s2", "s3", "plant", "viewer", "router"}


@pytest.fixture
def mesh(demo: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(demo, tmp_path / "mesh.toml"))


def certificate(file: Path) -> x509.Certificate:
    return x509.load_pem_x509_certificate(file.read_bytes())


def test_it_makes_an_authority_and_a_certificate_for_each_peer(mesh: Path) -> None:
    assert main(["keys", "init", str(mesh), "--host", "lab-7", "--host", "10.0.0.7", "--days", "30"]) == 0
    folder = mesh.parent / "keys"
    assert {file.stem for file in folder.iterdir()} == {*PEERS, "ca"}
    authority = certificate(folder / "ca.pem")
    for name in PEERS:
        own = certificate(folder / f"{name}.pem")
        own.verify_directly_issued_by(authority)
        (common_name,) = own.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
        assert common_name.value == name
        hosts = own.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        assert hosts.get_values_for_type(x509.DNSName) == ["localhost", "lab-7"]
        assert [str(ip) for ip in hosts.get_values_for_type(x509.IPAddress)] == ["127.0.0.1", "::1", "10.0.0.7"]
        assert not own.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
        assert (own.not_valid_after_utc - own.not_valid_before_utc).days == 30
        key = load_pem_private_key((folder / f"{name}.key").read_bytes(), None)
        assert key.public_key() == own.public_key()


def test_keys_are_for_their_owner_only(mesh: Path) -> None:
    main(["keys", "init", str(mesh)])
    keys = list((mesh.parent / "keys").glob("*.key"))
    assert len(keys) == len(PEERS) + 1
    assert {stat.S_IMODE(key.stat().st_mode) for key in keys} == {0o600}


def test_a_second_time_it_makes_what_is_missing_with_the_same_authority(mesh: Path) -> None:
    main(["keys", "init", str(mesh)])
    folder = mesh.parent / "keys"
    before = {file: file.read_bytes() for file in folder.iterdir()}
    for file in (folder / "s2.pem", folder / "s2.key"):
        file.unlink()
    assert main(["keys", "init", str(mesh)]) == 0
    after = {file: file.read_bytes() for file in folder.iterdir()}
    assert {file.name for file in after if before[file] != after[file]} == {"s2.pem", "s2.key"}
    certificate(folder / "s2.pem").verify_directly_issued_by(certificate(folder / "ca.pem"))


def test_half_a_pair_is_not_overwritten(mesh: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["keys", "init", str(mesh)])
    (mesh.parent / "keys" / "s2.pem").unlink()
    before = (mesh.parent / "keys" / "s2.key").read_bytes()
    assert main(["keys", "init", str(mesh)]) == 1
    assert "s2.key" in capsys.readouterr().err
    assert (mesh.parent / "keys" / "s2.key").read_bytes() == before


def test_one_file_for_all_peers_is_refused(mesh: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", "init", str(mesh), "-X", "network.tls.key=keys/all.key"]) == 1
    assert "{name}" in capsys.readouterr().err
    assert not (mesh.parent / "keys").exists()


def test_a_peer_without_its_files_says_how_to_make_them(mesh: Path, capsys: pytest.CaptureFixture[str]) -> None:
    secured = ["-c", str(mesh), "-X", "network.tls.enabled=true"]
    assert main(["sensor", "s1", *secured]) == 2
    error = capsys.readouterr().err
    assert "sensor s1" in error
    assert f"lsu-mesh keys init {mesh}" in error


def test_a_key_that_others_can_read_is_refused(mesh: Path) -> None:
    main(["keys", "init", str(mesh)])
    configuration = load(mesh, ["network.tls.enabled=true"])
    assert certificates(configuration, "s1") is not None
    key = mesh.parent / "keys" / "s1.key"
    key.chmod(0o640)
    with pytest.raises(InsecureSession, match="chmod 600"):
        certificates(configuration, "s1")


def test_without_tls_there_are_no_certificates(mesh: Path) -> None:
    assert certificates(load(mesh), "s1") is None


@pytest.mark.parametrize(
    "command",
    [
        ["sensor", "s1", "-l", "tcp/0.0.0.0:0"],
        ["filter", "box", "-l", "udp/10.1.2.3:7000"],
        ["router", "-l", "tcp/[::]:0"],
        ["run", "-X", "network.entry=tcp/0.0.0.0:0"],
        ["run", "-X", 'network.listen=["tcp/lab-7:7447"]'],
        ["recorder", "--cfg", 'listen/endpoints:["tcp/0.0.0.0:0"]'],
    ],
    ids=" ".join,
)
def test_listening_for_other_hosts_without_tls_is_refused(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command) == 2
    assert "--insecure" in capsys.readouterr().err

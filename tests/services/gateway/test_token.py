"""The token's file."""

from __future__ import annotations

from pathlib import Path

import pytest
from lsu_mesh_services.gateway.token import WrongToken, is_token, read_or_make


def test_a_token_is_made_once_and_only_its_owner_reads_it(tmp_path: Path) -> None:
    file = tmp_path / "mesh.gateway-token"
    token, is_new = read_or_make(file)
    assert is_new
    assert len(token) >= 40
    assert file.stat().st_mode & 0o777 == 0o600
    assert read_or_make(file) == (token, False)
    assert read_or_make(tmp_path / "other")[0] != token


def test_a_file_that_others_read_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text("a" * 40)
    file.chmod(0o640)
    with pytest.raises(WrongToken, match=f"mode 0640.*chmod 600 {file}"):
        read_or_make(file)


@pytest.mark.parametrize("content", ["", "short", "two words that are long enough", "ü" * 40])
def test_what_is_no_token_is_refused(content: str, tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.touch(0o600)
    file.write_text(content)
    with pytest.raises(WrongToken, match=str(file)):
        read_or_make(file)


def test_a_place_where_nothing_can_be_written_is_said(tmp_path: Path) -> None:
    with pytest.raises(WrongToken, match="choose another place with --token-file"):
        read_or_make(tmp_path / "no" / "token")


def test_only_the_token_is_the_token() -> None:
    assert is_token("abc", "abc")
    assert not is_token("", "abc")
    assert not is_token("abcd", "abc")
    assert not is_token("äbc", "abc")

"""The token that allows to publish: a file that its owner alone can read."""

from __future__ import annotations

import hmac
import os
import secrets
from pathlib import Path

from lsu_mesh_services.network.security import SHARED

LEAST = 16
"""Characters of a token that nobody guesses."""


class WrongToken(Exception):
    """The file holds no usable token; the text says why and what to do."""


def read_or_make(path: Path) -> tuple[str, bool]:
    """The token in a file, and whether the file was made now, readable by its owner only.

    Raises
    ------
    WrongToken
        When others can read the file, it cannot be read or made, or the token is too short.
    """
    try:
        return _made(path), True
    except FileExistsError:
        return _read(path), False
    except OSError as error:
        text = f"cannot be made: {error.strerror}; choose another place with --token-file"
        raise WrongToken(f"--token-file {path}: {text}") from None


def is_token(given: str, token: str) -> bool:
    """Whether they are equal, in a time that does not tell how much of them is."""
    return hmac.compare_digest(given.encode(), token.encode())


def _made(path: Path) -> str:
    token = secrets.token_urlsafe(32)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="ascii") as file:
        os.fchmod(file.fileno(), 0o600)
        file.write(f"{token}\n")
    return token


def _read(path: Path) -> str:
    try:
        mode = path.stat().st_mode & 0o777
        token = path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise WrongToken(f"--token-file {path}: cannot be read: {error}") from None
    if mode & SHARED:
        raise WrongToken(f"--token-file {path}: others can read it (mode {mode:04o}); chmod 600 {path}")
    if len(token) < LEAST or not token.isprintable() or " " in token:
        text = f"expected one word of at least {LEAST} characters; remove the file, and a token is made"
        raise WrongToken(f"--token-file {path}: {text}")
    return token

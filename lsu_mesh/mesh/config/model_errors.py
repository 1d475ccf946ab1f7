"""What a constructor says of its arguments, as mistakes of the keys that gave them."""

from __future__ import annotations

import re

from lsu_mesh.mesh.config.table import Table

MUST = re.compile(r"(?:\w+ )?must (?:be |have |hold )?(?P<what>.+?)(?:[,:] (?:it|they|not|found)\b.*)?$", re.DOTALL)


def add_model_error(table: Table, sentence: str, key: str = "") -> None:
    """Note a sentence such as ``rho must have 3 entries, it has 2`` at the key that it begins with, or at ``key``."""
    word = re.match(r"\w+", sentence)
    if not key and word is not None and word[0] in table.values:
        key = word[0]
    text = sentence.removeprefix(f"{key} ") if key else sentence
    table.wrong(key, text, expected_of(sentence))


def expected_of(sentence: str) -> str:
    """What a sentence with "must" asks for; the sentence itself where it has none."""
    match = MUST.match(sentence)
    return match["what"] if match else sentence

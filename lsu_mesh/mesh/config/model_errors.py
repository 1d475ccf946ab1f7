"""What a constructor says of its arguments, as mistakes of the keys that gave them."""

from __future__ import annotations

import re

from lsu_mesh.mesh.config.table import Table

MUST = re.compile(r"(?:\w+ )?must (?:be |have |hold )?(?P<what>.+?)(?:[,:] (?:it|they|not|found)\b.*)?$", re.DOTALL)

KEYS = {"a": "offset", "d": "offset"}
"""Arguments of a model that have another name in the file."""


def add_model_error(table: Table, sentence: str, key: str = "") -> None:
    """Note a sentence such as ``rho must have 3 entries, it has 2`` at the key that it begins with, or at ``key``."""
    word = re.match(r"\w+", sentence)
    named = KEYS.get(word[0], word[0]) if word is not None else ""
    if not key and word is not None and named in table.values:
        key, sentence = named, f"{named}{sentence[word.end() :]}"
    text = sentence.removeprefix(f"{key} ") if key else sentence
    table.wrong(key, text, expected_of(sentence))


def expected_of(sentence: str) -> str:
    """What a sentence with "must" asks for; the sentence itself where it has none."""
    match = MUST.match(sentence)
    return match["what"] if match else sentence

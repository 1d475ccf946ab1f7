"""Results of ``lsu-mesh bench`` as a JSON file: what was measured, of which commit, when and on what machine."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from lsu_mesh.errors import ModelError
from lsu_mesh.experiments.machine_facts import Facts
from lsu_mesh.experiments.mesh_speed.bench_kinds import KINDS

SCHEMA = "lsu-mesh bench 1"
"""Raised when a field changes its meaning; fields may be added without."""
_UNFIT = re.compile(r"[^0-9A-Za-z]+")


class BenchFile(NamedTuple):
    """One run of a command of ``lsu-mesh bench``."""

    what: str
    """A key of ``KINDS``."""
    commit: str | None
    """Short hash of the commit that was measured, with ``+`` after it where files differed from it."""
    date: str
    """UTC, ISO 8601."""
    machine: Facts
    cases: Sequence[Mapping[str, Any]]

    def text(self) -> str:
        """JSON, one line a case."""
        head = {"schema": SCHEMA, **self._asdict()}
        del head["cases"]
        lines = [f" {json.dumps(name)}: {json.dumps(value, ensure_ascii=False)}," for name, value in head.items()]
        cases = ",\n".join(f"  {json.dumps(dict(case), ensure_ascii=False)}" for case in self.cases)
        return "\n".join(["{", *lines, ' "cases": [', cases, " ]", "}"]) + "\n"

    @property
    def file_name(self) -> str:
        """``DATE-WHAT-COMMIT.json``, in the order of time when sorted."""
        date = _UNFIT.sub("", self.date[:16]).lower()
        return f"{date}-{self.what}-{_UNFIT.sub('', self.commit or 'unknown')}.json"


def read_bench_file(path: Path) -> BenchFile:
    """Read what :meth:`BenchFile.text` wrote.

    Raises
    ------
    ModelError
        When there is no such file, or it is none of this schema.
    """
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError:
        raise ModelError(f"{path}: is no JSON; expected a file that lsu-mesh bench … --out wrote") from None
    schema = values.get("schema") if isinstance(values, dict) else None
    if schema != SCHEMA:
        raise ModelError(f"{path}: expected the schema {SCHEMA!r}, found {schema!r}; measure again with this release")
    what = values.get("what")
    if what not in KINDS:
        raise ModelError(f"{path}: holds {what!r}; expected one of {', '.join(KINDS)}")
    cases, machine = values.get("cases"), values.get("machine")
    if not isinstance(cases, list) or not isinstance(machine, dict) or not all(_is_case(what, case) for case in cases):
        raise ModelError(f"{path}: its cases lack {', '.join(KINDS[what].keys)}, or its machine is missing")
    commit = values.get("commit")
    return BenchFile(what, None if commit is None else str(commit), str(values.get("date")), machine, cases=cases)


def _is_case(what: str, case: object) -> bool:
    if not isinstance(case, dict):
        return False
    return all(isinstance(case.get(name), str | int | float) for name in KINDS[what].keys)

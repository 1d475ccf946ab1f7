"""The files that a mesh plays, read once before anything starts: mistakes, warnings and the account of each."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.config.measurement_files import accounts
from lsu_mesh.mesh.config.problem import DataProblem, data_doubt
from lsu_mesh.mesh.data_files import DataFileError
from lsu_mesh.mesh.data_files.account import Account

Accounts = Mapping[str, Account]


def accounts_or_explain(configuration: Configuration) -> Accounts | None:
    """What becomes of the rows of each file, by the table that names it; None after mistakes were printed on stderr.

    Whatever is left out is a warning on stderr.
    """
    try:
        found = accounts(configuration)
    except DataFileError as error:
        print(explained(error), file=sys.stderr)
        return None
    for warning in account_warnings(found):
        print(warning, file=sys.stderr)
    return found


def explained(error: DataFileError) -> str:
    """The mistakes for people, and their count."""
    count = len(error.lines)
    return "\n".join([*error.lines, f"{count} mistake{'s' if count > 1 else ''}; nothing was started"])


def as_records(found: Accounts) -> dict[str, dict[str, Any]]:
    """For a line of JSON: the fields of each account by the table that names the file."""
    return {table: asdict(one) for table, one in found.items()}


def account_warnings(found: Accounts) -> list[str]:
    """One line per doubt."""
    return [str(record) for record in warning_records(found)]


def warning_records(found: Accounts) -> list[DataProblem]:
    """The same with the table that names the file, for programs."""
    return [
        data_doubt(table, Path(one.path), text.removeprefix(f"{one.path}: "))
        for table, one in found.items()
        for text in one.warnings()
    ]


def last_step(configuration: Configuration, found: Accounts) -> int | None:
    """The last step of a run: that of ``[mesh] steps``, or of the longest file of a sensor if that ends before."""
    ends = [] if configuration.mesh.steps is None else [configuration.mesh.steps]
    played = [one.last_step for table, one in found.items() if table.startswith("sensors.")]
    return min([*ends, max(played)]) if played else min(ends, default=None)

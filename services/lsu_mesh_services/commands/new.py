"""``lsu-mesh new FILE``: write a configuration to start from."""

from __future__ import annotations

import argparse
import sys
import tomllib
from pathlib import Path

from lsu_mesh.mesh.config import ConfigurationError, load, load_values
from lsu_mesh.mesh.config.measurement_files import accounts
from lsu_mesh.mesh.data_files import DataFileError
from lsu_mesh_services.configuration import DEMO
from lsu_mesh_services.exit_codes import FAILURE, OK, USAGE
from lsu_mesh_services.new_mesh.external import EXTERNAL
from lsu_mesh_services.new_mesh.from_demo import demo_text
from lsu_mesh_services.new_mesh.from_file import file_text
from lsu_mesh_services.new_mesh.survey import survey


def main(options: argparse.Namespace) -> int:
    target = Path(options.file).expanduser()
    try:
        text = _text(options, target)
    except DataFileError as error:
        print(error, file=sys.stderr)
        return USAGE
    if text is None:
        print(f"new: expected --from demo or --from file DATA.csv, found {' '.join(options.source)!r}", file=sys.stderr)
        return USAGE
    try:
        with target.open("w" if options.force else "x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        print(f"{target}: is there already; --force writes over it", file=sys.stderr)
        return USAGE
    except OSError as error:
        print(f"{target}: cannot be written: {error.strerror}", file=sys.stderr)
        return FAILURE
    return _checked(target)


def _text(options: argparse.Namespace, target: Path) -> str | None:
    match options.source:
        case ["demo"]:
            return demo_text(DEMO)
        case ["file", path]:
            columns = None if options.columns is None else options.columns.split(",")
            return file_text(survey(Path(path).expanduser(), options.time, options.step, columns), target)
        case ["external"] if _is_known(EXTERNAL, target):
            return EXTERNAL
    return None


def _is_known(text: str, target: Path) -> bool:
    """Whether this version reads such a configuration."""
    try:
        load_values(tomllib.loads(text), target)
    except ConfigurationError:
        return False
    return True


def _checked(target: Path) -> int:
    """Read what was written, as ``validate`` does, and say what to do next."""
    try:
        for account in accounts(load(target)).values():
            print(*account.lines(), sep="\n", file=sys.stderr)
    except (ConfigurationError, DataFileError) as error:
        print(f"{target}: was written, and needs a change:\n{error}", file=sys.stderr)
        return FAILURE
    print(f"{target}: written; next: lsu-mesh validate {target} and lsu-mesh run {target}", file=sys.stderr)
    return OK

"""``lsu-mesh recording info|repair|merge|export``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from lsu_mesh_services.commands.replay import read_or_explain
from lsu_mesh_services.exit_codes import FAILURE, OK, USAGE

if TYPE_CHECKING:
    from lsu_mesh_services.recording.read import Recording


def main(options: argparse.Namespace) -> int:
    actions = {"info": _info, "repair": _repair, "merge": _merge, "export": _export}
    return actions[options.action](options)


def _info(options: argparse.Namespace) -> int:
    from lsu_mesh_services.recording.summary import print_summary, summary

    path = Path(options.file)
    try:
        found = summary(path)
    except OSError as error:
        print(f"{path}: cannot be read: {error.strerror or error}", file=sys.stderr)
        return USAGE
    except ValueError as error:
        print(error, file=sys.stderr)
        return USAGE
    print_summary(found, as_json=options.json)
    return OK


def _repair(options: argparse.Namespace) -> int:
    file = Path(options.file)
    return _write_repaired([file], _output(options, file, "repaired"), options)


def _merge(options: argparse.Namespace) -> int:
    from lsu_mesh_services.recording.part_files import parts

    files = [Path(name) for name in options.files]
    if len(files) == 1:
        files = list(parts(files[0]))
        if len(files) == 1:
            print(f"{files[0]}: has no later parts beside it; name the files to join", file=sys.stderr)
            return USAGE
    return _write_repaired(files, _output(options, files[0], "merged"), options)


def _output(options: argparse.Namespace, file: Path, word: str) -> Path:
    return file.with_name(f"{file.stem}.{word}{file.suffix}") if options.out is None else Path(options.out)


def _write_repaired(files: list[Path], target: Path, options: argparse.Namespace) -> int:
    from lsu_mesh_services.recording.losses import damage_words
    from lsu_mesh_services.recording.repair import repair

    if target.exists() and not options.force:
        print(f"{target}: exists already; choose another file with -o, or overwrite it with --force", file=sys.stderr)
        return USAGE
    before = 0
    try:
        before = sum(file.stat().st_size for file in files)
        found = repair(files, target)
    except OSError as error:
        print(f"{error.filename or target}: {error.strerror or error}", file=sys.stderr)
        return USAGE if isinstance(error, FileNotFoundError) else FAILURE
    except ValueError as error:
        print(error, file=sys.stderr)
        return FAILURE
    after = target.stat().st_size
    lost = sum(loss.messages for loss in found.losses)
    for words in damage_words(found.damage, lost, found.losses):
        print(words, file=sys.stderr)
    print(f"{' + '.join(map(str, files))} → {target}: {before / 1e6:.3g} MB → {after / 1e6:.3g} MB")
    return OK


def _export(options: argparse.Namespace) -> int:
    file = Path(options.file)
    recording = read_or_explain(file)
    if recording is None:
        return USAGE
    target = file.with_suffix(".mcap" if options.format == "mcap" else "") if options.out is None else Path(options.out)
    try:
        written = _exported(recording, target, options.format)
    except OSError as error:
        text, what = error.strerror or str(error), "file" if options.format == "mcap" else "folder"
        print(f"{error.filename or target}: cannot be written: {text}; choose a {what} with -o", file=sys.stderr)
        return FAILURE
    for path in written:
        print(path)
    return OK


def _exported(recording: Recording, target: Path, form: str) -> list[Path]:
    if form == "mcap":
        from lsu_mesh_services.recording.mcap_file import write_mcap

        return [write_mcap(recording, target)]
    from lsu_mesh_services.recording.export import export

    return export(recording, target, form)

"""Options of ``lsu-mesh recording``."""

from __future__ import annotations

import argparse

from lsu_mesh_services.extras import MCAP, RECORD, Extra
from lsu_mesh_services.options.parsing import EXIT_CODES, Commands, new_command


def add(commands: Commands) -> None:
    """The command ``recording`` and what it does to a recording."""
    parser = new_command(commands, "recording", "sum up, repair, join and export recordings")
    inner = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    info = _new(inner, "info", "what a recording holds: run, peers, messages, gaps, events")
    info.add_argument("file", metavar="FILE.rrd", help="recording; its parts are found beside it")
    info.add_argument("--json", action="store_true", help="one JSON object on stdout")
    repair = _new(inner, "repair", "write a file that opens, from one that is damaged or cut short")
    repair.add_argument("file", metavar="FILE.rrd", help="recording to repair; it is not changed, unless -o names it")
    _add_output(repair, "FILE.repaired.rrd")
    merge = _new(inner, "merge", "join the parts that a restarted recorder wrote into one recording")
    merge.add_argument("files", metavar="FILE.rrd", nargs="+", help="parts; of one file its later parts are found")
    _add_output(merge, "FILE.merged.rrd")
    words = "tables for other programs and measurements as files that sensors play, or all messages as MCAP"
    export = _new(inner, "export", words)
    export.add_argument("file", metavar="FILE.rrd", help="recording; its parts are found beside it")
    export.add_argument(
        "--format", choices=("csv", "parquet", "mcap"), default="csv",
        help="csv or parquet: tables in a folder; mcap: one file for Foxglove and others (default: csv)",
    )  # fmt: skip
    export.add_argument(
        "-o", "--out", metavar="OUT",
        help="a new or empty folder (default: FILE without .rrd), or the new MCAP file (default: FILE.mcap)",
    )  # fmt: skip
    parser.set_defaults(handler="lsu_mesh_services.commands.recording", extra=_extra)


def _extra(options: argparse.Namespace) -> Extra:
    return MCAP if getattr(options, "format", None) == "mcap" else RECORD


def _new(inner: Commands, name: str, words: str) -> argparse.ArgumentParser:
    return inner.add_parser(
        name, help=words, description=f"{words[0].upper()}{words[1:]}.", epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip


def _add_output(parser: argparse.ArgumentParser, default: str) -> None:
    parser.add_argument("-o", "--out", metavar="OUT.rrd", help=f"file to write (default: {default})")
    parser.add_argument("--force", action="store_true", help="overwrite the file")

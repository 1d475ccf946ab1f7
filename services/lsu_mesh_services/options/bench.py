"""Options of ``lsu-mesh bench``."""

from __future__ import annotations

import argparse

from lsu_mesh_services.extras import MESH, RECORD
from lsu_mesh_services.options.parsing import EXIT_CODES, Commands, new_command

HANDLERS = "lsu_mesh_services.commands"


def add(commands: Commands) -> None:
    """The command ``bench`` and what it measures."""
    parser = new_command(commands, "bench", "measure speed and tightness, as ratios wherever there is something beside")
    inner = parser.add_subparsers(dest="what", metavar="WHAT", required=True)
    _add_kernels(inner)
    _add_tightness(inner)
    _add_recording(inner)
    _add_mesh(inner)
    _add_throughput(inner)
    _add_scale(inner)
    _add_start(inner)
    _add_compare(inner)


def _add_kernels(inner: Commands) -> None:
    words = "cost of steps, hulls, banks and a new process beside other libraries, in one run on one core"
    parser = _new(inner, "kernels", words, "bench", extra=None)
    parser.add_argument("--quick", action="store_true", help="few sizes and rounds: a trial, whose numbers mean little")
    parser.add_argument("--out", metavar="DIR", help="folder for the figure and the JSON file (needs matplotlib)")
    parser.add_argument("--json", action="store_true", help="one JSON line on stdout instead of tables")


def _add_tightness(inner: Commands) -> None:
    words = "hulls beside the exact ones and the published estimators of a benchmark"
    parser = _new(inner, "tightness", words, "tightness", extra=None)
    parser.add_argument(
        "--benchmarks", nargs="+", default=[], metavar="FILE", help="JSON files of published benchmarks"
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="one JSON line a benchmark on stdout instead of tables")


def _add_recording(inner: Commands) -> None:
    words = "processor time and bytes of recording 12 filters at 200 Hz, batched and one by one"
    parser = _new(inner, "recording", words, "recording_cost", extra=RECORD)
    parser.add_argument("--quick", action="store_true", help="fewer steps: a trial, whose numbers mean little")
    parser.add_argument("--json", action="store_true", help="one JSON line on stdout instead of text")


def _add_mesh(inner: Commands) -> None:
    words = "latency and processor time of a real mesh beside a relay of the same shape that does no work"
    parser = _new(
        inner, "mesh", words, "bench_mesh", extra=lambda options: RECORD if options.recorder else MESH
    )  # fmt: skip
    parser.add_argument(
        "--rate", type=float, nargs="+", default=[], metavar="HZ",
        help="steps a second, 10 to 1000; several are measured one after the other",
    )  # fmt: skip
    parser.add_argument(
        "--filters", type=int, nargs="+", default=[], metavar="N",
        help="filters, 1 to 12; every rate is measured with every number (default of both: three cases)",
    )  # fmt: skip
    parser.add_argument("--recorder", action="store_true", help="with a recorder that listens to everything")
    parser.add_argument(
        "--seconds", type=float, default=10.0, metavar="S", help="counted steps of a turn, in seconds (default: 10)"
    )  # fmt: skip
    parser.add_argument(
        "--turns", type=int, default=3, metavar="N", help="turns of relay and mesh, alternately (default: 3)"
    )  # fmt: skip
    parser.add_argument(
        "--tree", metavar="DIR", help="measure the mesh of another checkout beside the relay of this one"
    )  # fmt: skip
    _add_results(parser)


def _add_throughput(inner: Commands) -> None:
    words = "steps a second of one node without a network: decoding, admission, step, encoding; and of its parts"
    parser = _new(inner, "throughput", words, "bench_throughput", extra=None)
    parser.add_argument("--quick", action="store_true", help="few steps, one round: a trial, whose numbers mean little")
    _add_results(parser)


def _add_scale(inner: Commands) -> None:
    words = "cost against the processes of a mesh, sources of a fusion, states of a filter and instances of a bank"
    parser = _new(inner, "scale", words, "bench_scale", extra=lambda options: None if options.no_processes else MESH)
    parser.add_argument("--quick", action="store_true", help="few sizes, one round: a trial, whose numbers mean little")
    parser.add_argument("--no-processes", action="store_true", help="leave out the meshes of real processes")
    parser.add_argument("--page", metavar="FILE.md", help="write the page with projections, docs/scaling.md")
    _add_results(parser)


def _add_start(inner: Commands) -> None:
    words = "time from the start of a mesh to its first fused set, and the memory of each role some seconds later"
    parser = _new(inner, "start", words, "bench_start", extra=lambda options: RECORD if options.recorder else MESH)
    parser.add_argument("--recorder", action="store_true", help="with a recorder that listens to everything")
    parser.add_argument(
        "--seconds", type=float, default=5.0, metavar="S",
        help="from the first fused set to the look at the memory (default: 5)",
    )  # fmt: skip
    parser.add_argument("--turns", type=int, default=3, metavar="N", help="starts of the mesh (default: 3)")
    parser.add_argument("--tree", metavar="DIR", help="measure the mesh of another checkout")
    _add_results(parser)


def _add_compare(inner: Commands) -> None:
    words = "compare two files of results: every number of the second as a ratio to that of the first"
    parser = _new(inner, "compare", words, "bench_compare", extra=None)
    parser.add_argument("first", metavar="A.json", help="file that --save or --out wrote")
    parser.add_argument("second", metavar="B.json", help="another one, of the same command")
    parser.add_argument("--json", action="store_true", help="one JSON line a number on stdout instead of a table")


def _add_results(parser: argparse.ArgumentParser) -> None:
    """How results are told and kept."""
    parser.add_argument("--json", action="store_true", help="one JSON line a case on stdout instead of tables")
    parser.add_argument("--save", action="store_true", help="keep the results in benchmarks/history")
    parser.add_argument("--out", metavar="FILE", help="keep the results in this JSON file")


def _new(inner: Commands, name: str, words: str, handler: str, *, extra: object) -> argparse.ArgumentParser:
    parser = inner.add_parser(
        name, help=words, description=f"{words[0].upper()}{words[1:]}.", epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.set_defaults(handler=f"{HANDLERS}.{handler}", extra=extra)
    return parser

"""Options of ``lsu-mesh bench``."""

from __future__ import annotations

from lsu_mesh_services.extras import RECORD
from lsu_mesh_services.options.parsing import Commands, new_command


def add(commands: Commands) -> None:
    """The command ``bench``."""
    parser = new_command(commands, "bench", "measure speed and tightness beside other libraries")
    parser.add_argument(
        "what",
        choices=("kernels", "tightness", "recording"),
        help="kernels: cost of steps, hulls, banks, a new process, as ratios in one run on one core; "
        "tightness: hulls beside the exact ones and the published estimators of a benchmark; "
        "recording: processor time and bytes of recording 12 filters at 200 Hz, batched and one by one",
    )
    parser.add_argument(
        "--benchmarks", nargs="+", default=[], metavar="FILE", help="tightness: JSON files of published benchmarks"
    )
    parser.add_argument("--quick", action="store_true", help="few sizes and rounds: a trial, whose numbers mean little")
    parser.add_argument("--out", metavar="DIR", help="folder for the figure and the JSON file (needs matplotlib)")
    parser.add_argument("--json", action="store_true", help="one JSON line on stdout instead of tables")
    parser.set_defaults(
        handler="lsu_mesh_services.commands.bench",
        extra=lambda options: RECORD if options.what == "recording" else None,
    )

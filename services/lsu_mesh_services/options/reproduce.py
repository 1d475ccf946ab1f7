"""Arguments of ``lsu-mesh reproduce``."""

from __future__ import annotations

import argparse
from typing import NamedTuple

from lsu_mesh_services.options.parsing import Commands, new_command


class Experiment(NamedTuple):
    """What a choice stands for: words for the help, and the modules of ``lsu_mesh.experiments`` that do it."""

    words: str
    modules: tuple[str, ...]


REPRODUCIBLE = {
    "p2006": Experiment("half-widths by linear programming, off-line and on a sliding window", ("p2006.experiment",)),
    "p2014": Experiment(
        "states, E, F and half-widths on a window; centred points, vertices, truncated Kalman filter",
        ("p2014.experiment",),
    ),
    "p2018": Experiment("LSUO beside the zonotopic Kalman filter on P3: Table 1, Figures 1–3", ("p2018.experiment",)),
    "l2019": Experiment(
        "LSUO and LSUP on S1, S2, S3 over a grid of noises: 16 criteria, 26 figures", ("l2019.experiment",)
    ),
    "p2023": Experiment(
        "LSUCZ beside LSUO and LSUP over the observation noise: Tables 1, 2, Figures 1–3", ("p2023.experiment",)
    ),
    "fusion": Experiment(
        "three filters and their fusion on P3; Bayesian transfer against the source's noise", ("fusion", "transfer")
    ),
    "cora": Experiment("published benchmark systems: our filters beside published estimators", ("cora",)),
}
"""In the order of ``reproduce all`` and of its page."""
ALL = "all"
WITH_BENCHMARKS = "cora"
"""The choice that reads published systems from a folder that the user has."""


def add(commands: Commands) -> None:
    """The command ``reproduce``."""
    parser = new_command(
        commands, "reproduce", "run a paper's experiment: its tables beside ours, figures, and checks of numbers"
    )
    listed = "; ".join(f"{what}: {experiment.words}" for what, experiment in REPRODUCIBLE.items())
    parser.add_argument(
        "what", metavar="WHAT", choices=(*REPRODUCIBLE, ALL), help=f"{listed}; {ALL}: everything, and a page about it"
    )
    parser.add_argument("--quick", action="store_true", help="fewer seeds and steps")
    parser.add_argument("--json", action="store_true", help="JSON lines on stdout instead of tables")
    parser.add_argument(
        "--out", metavar="DIR",
        help=f"folder for CSV, Markdown and PNG files (default: only print); {ALL}: DIR/papers.md and DIR/papers",
    )  # fmt: skip
    parser.add_argument("--seed", type=_seed, default=1, metavar="S", help="first seed of the simulations (default: 1)")
    parser.add_argument(
        "--benchmarks", metavar="DIR", help=f"{WITH_BENCHMARKS}: folder of the published systems (JSON files)"
    )
    parser.set_defaults(handler="lsu_mesh_services.commands.reproduce")


def _seed(text: str) -> int:
    if not text.isdigit():
        raise argparse.ArgumentTypeError(f"expected an integer, 0 or more; found {text!r}")
    return int(text)

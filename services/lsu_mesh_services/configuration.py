"""The configuration of a command, from its options."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from lsu_mesh.mesh.config import Configuration, ConfigurationError, load

DEMO = Path(__file__).resolve().parent / "demo.toml"


def load_or_explain(
    file: str | None, options: argparse.Namespace, *, makes_filters: bool = True
) -> Configuration | None:
    """The configuration, or None after its mistakes have been printed on stderr.

    Without ``makes_filters`` the filters' classes do not check their own options: then no kernel is loaded.
    """
    path = DEMO if file is None else Path(file)
    try:
        return load(path, [*flags(options), *options.overrides], os.environ, makes_filters=makes_filters)
    except ConfigurationError as error:
        print_problems(error)
        return None


def print_warnings(configuration: Configuration) -> None:
    """One line per doubt on stderr."""
    for warning in configuration.warnings:
        print(warning, file=sys.stderr)


def flags(options: argparse.Namespace) -> list[str]:
    """The overrides that short flags stand for."""
    named = {"steps": "mesh.steps", "rate": "mesh.rate", "seed": "mesh.seed"}
    given = {path: getattr(options, flag, None) for flag, path in named.items()}
    return [f"{path}={value}" for path, value in given.items() if value is not None]


def print_problems(error: ConfigurationError) -> None:
    """One line per mistake on stderr."""
    for line in error.problems:
        print(line, file=sys.stderr)
    count = len(error.problems)
    print(f"{count} mistake{'s' if count > 1 else ''}; nothing was started", file=sys.stderr)

"""The configuration of a mesh: a TOML file, checked in full before anything starts."""

from lsu_mesh.mesh.config.load import load, load_values, load_with_keys
from lsu_mesh.mesh.config.problem import ConfigurationError, Problem
from lsu_mesh.mesh.config.settings import Configuration

__all__ = ["Configuration", "ConfigurationError", "Problem", "load", "load_values", "load_with_keys"]

"""The configuration of a mesh: a TOML file, checked in full before anything starts."""

from lsu_mesh.mesh.config.load import load, load_values, load_with_keys
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.config.table import ConfigurationError

__all__ = ["Configuration", "ConfigurationError", "load", "load_values", "load_with_keys"]

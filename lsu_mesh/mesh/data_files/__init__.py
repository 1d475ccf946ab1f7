"""Files of recorded data: CSV, Parquet and NumPy, read exactly, refused in plain words, every row accounted for."""

from lsu_mesh.mesh.data_files.data_file import DataFile
from lsu_mesh.mesh.data_files.problems import DataFileError
from lsu_mesh.mesh.data_files.read import columns_of, look, read
from lsu_mesh.mesh.data_files.settings import DataFileSettings

__all__ = ["DataFile", "DataFileError", "DataFileSettings", "columns_of", "look", "read"]

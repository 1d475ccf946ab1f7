"""``python -m lsu_mesh_services`` is ``lsu-mesh``."""

from lsu_mesh_services.cli import entry

if __name__ == "__main__":
    entry()

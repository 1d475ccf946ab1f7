"""``python -m services`` is ``lsu-mesh``."""

from services.cli import entry

if __name__ == "__main__":
    entry()

"""The recording of a mesh as a Rerun file: raw payloads to compute with, drawings to look at.

The only folder that imports rerun. What lies where in a recording stands in ``names.py``, what opens first in
``blueprint.py``.
"""

"""The recording of a mesh as a Rerun file: raw payloads to compute with, drawings to look at.

The only folder that imports rerun. What lies where in a recording stands in ``names.py``, what opens first in
``blueprint.py``.
"""

import os

# Rerun reads this once, when it is imported. Files without an index are meant (see ``stream.py``): no warning at each.
os.environ.setdefault("RUST_LOG", "info,re_perf_telemetry=warn,re_log_encoding=error")

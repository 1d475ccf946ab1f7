"""Processes that are measured: a mesh of real peers and the relay beside it, for ``lsu-mesh bench mesh|scale|start``.

``process_group.py`` starts and ends them, ``process_usage.py`` reads their processor time and memory,
``relay_process.py`` is one process of the relay and ``relay_plan.py`` says what each of them passes on, ``sides.py``
starts either the real mesh or the relay, ``measured_run.py`` listens to its fused sets, and ``turns.py`` runs both
alternately. ``keep_results.py`` writes files of results, ``table.py`` prints.
"""

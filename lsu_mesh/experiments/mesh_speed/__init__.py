"""How fast a mesh and its nodes are: the mathematics of ``lsu-mesh bench mesh|throughput|scale|start|compare``.

``benchmark_mesh.py`` is the mesh that is measured and ``local_steps.py`` its messages without a network;
``quantiles.py``, ``mesh_case.py`` and ``mesh_report.py`` turn latencies into ratios to a relay of the same shape;
``bench_file.py`` keeps results and ``comparison.py`` compares two of them. ``lsu_mesh_services/benchmarks/`` starts the
processes.
"""

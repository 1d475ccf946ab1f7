"""How fast the kernels are, as ratios to other implementations measured in the same run on one core.

``stopwatch.py`` measures, ``plain_numpy.py`` and ``other_libraries.py`` are what the kernels are compared with;
``steps.py``, ``hulls.py``, ``constrained_steps.py`` and ``start.py`` are the comparisons, ``report.py`` puts them
together and ``figures.py`` draws them.
"""

"""The sets that hold a state, one file each, behind one contract (``support.py``).

Each set converts itself into the others (an orthotope into a parallelotope, a parallelotope into a zonotope, every one
into a constrained zonotope, every one into the orthotope around it), so these files import each other. It is the only
circle of imports of the project; ``tests/test_architecture.py`` allows this one and no other.
"""

"""Numbers of the operations on a tape."""

from __future__ import annotations

CONSTANT = 0
VARIABLE = 1
ADD = 2
SUBTRACT = 3
MULTIPLY = 4
DIVIDE = 5
NEGATE = 6
SQUARE = 7
POWER = 8
SQRT = 9
EXP = 10
LOG = 11
SIN = 12
COS = 13
TAN = 14
ATAN = 15
ASIN = 16
ACOS = 17
ATAN2 = 18
ATAN2_ANY = 19
"""``atan2`` where any branch will do, as an angle that is known up to turns."""
ABS = 20
SIGN = 21
SINH = 22
COSH = 23
TANH = 24
MIN = 25
MAX = 26
TWO_ARGUMENTS = frozenset({ADD, SUBTRACT, MULTIPLY, DIVIDE, ATAN2, ATAN2_ANY, MIN, MAX})
NO_ARGUMENTS = frozenset({CONSTANT, VARIABLE})

"""Point estimates beside a set: a Kalman recursion, its truncation at the hull, and the nearest point of the set."""

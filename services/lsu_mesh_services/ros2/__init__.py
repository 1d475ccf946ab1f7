"""A second session, with a network of ROS 2."""

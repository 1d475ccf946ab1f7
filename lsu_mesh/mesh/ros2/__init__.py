"""ROS 2 without its installation: names and keys on Zenoh, attachments, tokens of its graph, and messages as numbers.

Nothing here imports zenoh. ``rosbags``, which knows the types and their encoding, is imported where it is used.
"""

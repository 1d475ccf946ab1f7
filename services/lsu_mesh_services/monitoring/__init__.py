"""Listening to a mesh and summing up the messages."""

"""The peers of a mesh as pure state machines; the services around them own network and clock."""

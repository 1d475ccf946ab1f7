"""The options of each command, one file a group; light imports only, because ``--help`` reads them all."""

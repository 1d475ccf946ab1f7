"""What a peer needs of its network beside the bus: security, queues, gaps, broken links."""

"""Lainová et al. 2019: LSUO and LSUP on the systems S1 to S3."""

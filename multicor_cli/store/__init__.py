"""Files of a run: segments, checkpoints, results, reading and verifying them."""

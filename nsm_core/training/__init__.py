"""Training: batches from data and from the network's own roll-outs, schedule, checkpoints."""

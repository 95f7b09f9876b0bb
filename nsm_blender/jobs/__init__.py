"""Job files of the batch."""

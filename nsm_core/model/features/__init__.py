"""The state of a character, and the one place that names every slice of the network's vectors."""

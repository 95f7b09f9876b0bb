"""The network: its features, its modules and how it is stepped."""

"""Pictures to judge motion by."""

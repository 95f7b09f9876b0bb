"""Windows of captures to learn transitions from, with ground fitted under them (papers/001 section 3.3)."""

"""What a transition network reads and tells of a gap (papers/001 section 3)."""

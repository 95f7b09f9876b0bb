"""What acts: the skeleton, its clips, its thickness and its contacts."""

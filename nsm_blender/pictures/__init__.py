"""Pictures and videos of takes."""

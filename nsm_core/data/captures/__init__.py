"""Capture files and folders: read, mapped onto the skeleton, and the sidecars beside them."""

"""The mannequin's mesh by code."""

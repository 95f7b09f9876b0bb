"""Performances of picking and placing for the controller, made of captured walks and reaches."""

"""Measures of motion and pictures to judge it by."""

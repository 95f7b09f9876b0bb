"""Volumetric sensors: how full the space around a character and inside an object is (papers: NSM section
4.3).
"""

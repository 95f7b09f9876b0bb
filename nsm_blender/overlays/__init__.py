"""What the character senses, plans and does, drawn over the scene: made as arrays in one place, for the
viewport and for pictures.
"""

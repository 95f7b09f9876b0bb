"""What a file holds of motion: channels across Blender's versions, which data is which, and what is kept to
be put back.
"""

"""From captures to training data: captures, annotation, matching, scenarios, augmentation, storage and
export.
"""

"""A scene as the core sees it: solids, ground, and what can be stood on."""

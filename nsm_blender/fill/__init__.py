"""Fill: missing frames between keys that stand, made and keyed on the animator's own action."""

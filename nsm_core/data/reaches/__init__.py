"""Ways of hands to things in generated kitchens, that planning learns from (papers/002 section 7)."""

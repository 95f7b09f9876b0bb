"""Networks as torch modules; nothing else in this package needs torch to be stepped."""

"""Networks: one protocol, one registry, and what each network is; only the modules that train need torch."""

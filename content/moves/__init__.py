"""A notation for parametric dance moves on the canonical body, and takes rendered from it."""

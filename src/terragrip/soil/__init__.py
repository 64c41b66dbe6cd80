"""Soils: from estimates to adhesion-slip curves, how far they can be trusted, and the library that keeps them."""

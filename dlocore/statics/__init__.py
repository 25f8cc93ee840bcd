"""Equilibria: where a cable that is held comes to rest."""

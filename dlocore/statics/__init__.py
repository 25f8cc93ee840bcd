"""Static equilibria: where a held cable comes to rest."""

"""Curves: how a cable lies at the start, fitted to points, ordered or as a mere cloud."""

"""Identify the parameters of a real cable from recordings of its motion or of its shapes at rest."""

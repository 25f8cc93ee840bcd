"""The HTTP routes: each is a few lines around the service."""

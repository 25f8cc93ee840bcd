"""The HTTP routes: thin, each a few lines around the service."""

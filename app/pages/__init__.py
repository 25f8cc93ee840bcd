"""Files of the web pages: their assets, the ready scenes, the web viewer of recordings."""

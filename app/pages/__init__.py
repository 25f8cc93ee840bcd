"""Files of the pages: their assets, the ready scenes, the web viewer of recordings."""

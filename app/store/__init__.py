"""Storage: runs and studies on disk, the latest predictions in memory."""

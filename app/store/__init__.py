"""Storage: runs, studies and kept cables on disk, the latest predictions in memory."""

"""What is kept: runs and studies on disk, the last predictions in memory."""

"""What the commands of ``dlo`` do."""

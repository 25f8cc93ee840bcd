"""Peers on the same cases in the same run: `python -m benchmarks.peers` (docs/peers.md)."""

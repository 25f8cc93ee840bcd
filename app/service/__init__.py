"""Predictions and measurements under way: workers, jobs, their events, and what they count."""

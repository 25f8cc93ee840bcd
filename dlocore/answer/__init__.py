"""The parts of an answer: iterations, reactions, contact forces, frames, stretch and effects, in world coordinates."""

"""Parts of an answer: how the solve went, reactions, frames and effects, in the world and in words."""

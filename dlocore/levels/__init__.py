"""One march on one grid, with all the effects that its motion calls for, and the messages about it."""

"""One march on one grid, with all the effects that its motion calls for, and what is to be said of it."""

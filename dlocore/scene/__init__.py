"""The input: a cable, its start shape, its grasps and loads, its surroundings, and the quality of the answer."""

"""What is asked: a cable, how it lies, what grasps and loads it, what surrounds it, how good the answer has to be."""

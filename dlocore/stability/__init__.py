"""Whether a disturbance of a motion grows: out of its plane, to one of two sides, anywhere."""

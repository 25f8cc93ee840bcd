"""The effects, one small file each: a frozen dataclass with the parameters, and the compiled pointwise law."""

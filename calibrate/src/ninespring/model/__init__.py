"""What an array is: the C code's plant and chip, array.toml and model.toml, the effects that a model may have, its numbers."""

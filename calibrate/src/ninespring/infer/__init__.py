"""What data say of one model: how likely they are by it, its numbers with their errors, what it predicts."""

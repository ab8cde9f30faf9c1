"""What a search found, said: named effects, rivals, what is left, experiments that would tell."""

"""Which model it is: what is missing, how sure that is, what it could be instead, and what would tell."""

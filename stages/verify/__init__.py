"""Stage 4b: whether a data set or a bag is what it claims to be."""

"""Stage 4b: verification of everything that a data set or a bag claims about itself."""

"""Trained weights that come with the package; MODEL_CARD.md says how they were made."""

"""Trained weights that come with the package; MODEL_CARD.md describes how they were made."""

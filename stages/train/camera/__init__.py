"""Trains an image detector on the pictures of drives."""

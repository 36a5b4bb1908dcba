"""What the published code of three data sets does, attack by attack: presets of our attacks."""

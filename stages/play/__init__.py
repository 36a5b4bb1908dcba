"""Play a bag into running programs."""

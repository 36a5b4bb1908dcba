"""Which sensor or station lied, told from what the vehicle itself had."""

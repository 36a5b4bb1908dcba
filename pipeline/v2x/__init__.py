"""Vehicle-to-everything messages: CAMs by ETSI's rules, the radio that carries them, what receivers keep."""

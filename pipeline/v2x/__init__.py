"""Vehicle-to-everything messages: CAMs by ETSI's rules, the radio channel, and receivers' Local Dynamic
Maps."""

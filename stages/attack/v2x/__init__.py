"""Attacks on V2X messages: they change what stations send, which the radio model then transmits again."""

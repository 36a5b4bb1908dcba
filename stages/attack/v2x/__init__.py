"""Attacks on V2X messages: what stations send is changed, and then sent again through the radio model."""

"""What surrounds every command: signals, the standard streams, and how a command ends."""

"""The environment of every command: signals, standard streams, and the end of a command."""

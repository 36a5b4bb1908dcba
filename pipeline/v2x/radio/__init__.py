"""The radio between stations: who receives which message, how strong, and when."""

"""The radio between stations: which station receives which message, with what power, and when."""

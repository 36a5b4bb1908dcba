"""What an image detector sees in clean and in attacked pictures."""

"""What adversarial bags record about their attacks: declarations, and label tables next to the bag."""

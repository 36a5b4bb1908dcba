"""What adversarial bags tell of their attacks: declarations, and tables of labels beside the bag."""

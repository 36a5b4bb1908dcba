"""The V2X domain of the simulation: stations, their clock, and what they hear."""

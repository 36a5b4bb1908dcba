"""V2X under attack: misbehaviour detection, the victim's Local Dynamic Map, and its collision warnings."""

"""V2X under attack: misbehaviour detection, what the victim believes, and what that makes it do."""

"""Jobs on a Ray cluster: the engine, its workers, and the files that travel to them."""

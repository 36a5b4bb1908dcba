"""GeoNetworking, the network layer of ITS-G5 (ETSI EN 302 636-4-1): the packets around BTP and CAMs."""

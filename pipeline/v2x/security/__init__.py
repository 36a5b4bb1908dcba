"""Signed messages of ITS-G5: certificates, envelopes and their verification (ETSI TS 103 097, IEEE 1609.2)."""

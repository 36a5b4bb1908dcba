"""Signed messages: certificates, envelopes and their verification (ETSI TS 103 097, IEEE 1609.2)."""

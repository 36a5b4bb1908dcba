"""ECDSA keys on NIST P-256, derived from a seed, and deterministic signatures (RFC 6979)."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.v2x.security.coer import CoerReader, EnvelopeError

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePublicKey

ORDER = 0xFFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551
"""The number of points of P-256."""

_CURVE_P256, _X_ONLY = b"\x80", b"\x80"
_COMPRESSED = {0x82: b"\x02", 0x83: b"\x03"}
"""EccP256CurvePoint's tags of compressed points, and the same in SEC 1."""


@cache
def _ecdsa() -> Any:
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.hashes import SHA256

    try:
        return ec.ECDSA(SHA256(), deterministic_signing=True)
    except TypeError:  # before 43
        raise UsageError(
            "v2x.security: etsi needs cryptography 43 or later; pip install --upgrade cryptography"
        ) from None


class VerificationKey:
    """A public key. encoded: EccP256CurvePoint, compressed, 33 bytes.

    Raises EnvelopeError for bytes that are no point on the curve.
    """

    def __init__(self, encoded: bytes) -> None:
        from cryptography.hazmat.primitives.asymmetric import ec

        self.encoded = encoded
        if len(encoded) != 33 or encoded[0] not in _COMPRESSED:
            raise EnvelopeError(f"{encoded.hex()} is no compressed point of P-256")
        try:
            self._key: EllipticCurvePublicKey = ec.EllipticCurvePublicKey.from_encoded_point(
                ec.SECP256R1(), _COMPRESSED[encoded[0]] + encoded[1:]
            )
        except ValueError:
            raise EnvelopeError(f"{encoded.hex()} is no point of P-256") from None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, VerificationKey) and self.encoded == other.encoded

    def __hash__(self) -> int:
        return hash(self.encoded)

    def is_signed(self, data: bytes, signature: bytes) -> bool:
        """Whether this key made the signature, 64 bytes, of the data."""
        from cryptography.exceptions import InvalidSignature
        from cryptography.hazmat.primitives.asymmetric.utils import encode_dss_signature

        r, s = int.from_bytes(signature[:32], "big"), int.from_bytes(signature[32:], "big")
        try:
            self._key.verify(encode_dss_signature(r, s), data, _ecdsa())
        except InvalidSignature:
            return False
        return True


class SigningKey:
    """A private key that a drive's seed and these names determine. public: its VerificationKey."""

    def __init__(self, seed: int, *names: str | int) -> None:
        from cryptography.hazmat.primitives.asymmetric import ec
        from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

        _ecdsa()
        rng = named_generator(seed, "v2x", "security", "key", *names)
        scalar = int.from_bytes(rng.bytes(48), "big") % (ORDER - 1) + 1
        self._key = ec.derive_private_key(scalar, ec.SECP256R1())
        point = self._key.public_key().public_bytes(Encoding.X962, PublicFormat.CompressedPoint)
        self.public = VerificationKey(bytes([point[0] | 0x80]) + point[1:])

    def sign(self, data: bytes) -> bytes:
        """The signature of the data, 64 bytes: r and s."""
        from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature

        r, s = decode_dss_signature(self._key.sign(data, _ecdsa()))
        return r.to_bytes(32, "big") + s.to_bytes(32, "big")


def encode_signature(signature: bytes) -> bytes:
    """Signature in COER, with the x coordinate of r alone."""
    return _CURVE_P256 + _X_ONLY + signature


def read_signature(reader: CoerReader) -> bytes:
    """The 64 bytes of a Signature in COER."""
    reader.expect(_CURVE_P256 + _X_ONLY, "the kind of signature")
    return reader.take(64)

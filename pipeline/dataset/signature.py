"""An Ed25519 signature of SHA256SUMS, and so of every byte of a data set.

The signature file is the 64 bytes of RFC 8032, as `openssl pkeyutl -sign -rawin` writes them; keys are PEM
files as `openssl genpkey -algorithm ed25519` and `openssl pkey -pubout` write them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.missing_library import missing_library_line
from advpipe.pipeline.dataset import checksums

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

FILE = checksums.SIGNATURE_FILE
KEY_FILE = "signer.pem"
"""The signer's public key as the data set carries it. It tells damage; whose it is, it cannot tell."""

_KEY_LIMIT_BYTES = 1 << 16
_HOW = "`openssl genpkey -algorithm ed25519 -out key.pem` makes one"


class NoLibraryError(AdvpipeError):
    """The library that signs and checks is not installed."""


def load_private_key(path: Path) -> Ed25519PrivateKey:
    """Raises AdvpipeError for anything but an unencrypted Ed25519 private key in PEM."""
    with _library():
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
        from cryptography.hazmat.primitives.serialization import load_pem_private_key
    data = _pem(path)
    if b" PRIVATE KEY-----" not in data and b"PUBLIC KEY-----" in data:
        raise UsageError(f"{path} is a public key; signing needs the private one")
    try:
        key = load_pem_private_key(data, password=None)
    except TypeError:
        raise UsageError(
            f"{path} is encrypted; decrypt it with `openssl pkey -in {path} -out plain.pem` and use that"
        ) from None
    except Exception:  # ValueError, and what the library has for keys that it does not support
        raise UsageError(f"{path} is not a PEM private key; {_HOW}") from None
    if not isinstance(key, Ed25519PrivateKey):
        raise UsageError(f"{path} is not an Ed25519 key; {_HOW}")
    return key


def load_public_key(path: Path) -> Ed25519PublicKey:
    """Raises AdvpipeError for anything but an Ed25519 public key in PEM."""
    with _library():
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
        from cryptography.hazmat.primitives.serialization import load_pem_public_key
    data = _pem(path)
    if b"PRIVATE KEY-----" in data:
        raise UsageError(
            f"{path} is a private key; checking needs the public one: `openssl pkey -in {path} -pubout`"
        )
    try:
        key = load_pem_public_key(data)
    except Exception:  # as above
        raise UsageError(f"{path} is not a PEM public key") from None
    if not isinstance(key, Ed25519PublicKey):
        raise UsageError(f"{path} is not an Ed25519 key")
    return key


def public_pem(key: Ed25519PrivateKey) -> bytes:
    """The public half of a key, as `openssl pkey -pubout` writes it."""
    from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

    return key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)


def sign_folder(folder: Path, private_key_path: Path) -> Path:
    """Sign a folder's SHA256SUMS; returns the signature's path."""
    key = load_private_key(private_key_path)
    target = folder / FILE
    target.write_bytes(key.sign(checksums.read_bytes(folder / checksums.FILE)))
    return target


def verify_signature(folder: Path, public_key_path: Path | None = None) -> None:
    """Check the signature of a folder's SHA256SUMS; raises AdvpipeError where it is missing or wrong.

    public_key_path: the signer's key as its owner gave it; without one, the key that lies in the folder,
    which proves that nothing was damaged since, but not who signed.
    """
    path = folder / FILE
    if not path.is_file():
        raise AdvpipeError(f"{path} does not exist: the data set is not signed")
    if public_key_path is None and not (folder / KEY_FILE).is_file():
        raise AdvpipeError(f"{folder} holds no {KEY_FILE}; give the signer's public key")
    key_path = public_key_path or folder / KEY_FILE
    key = load_public_key(key_path)
    from cryptography.exceptions import InvalidSignature

    with path.open("rb") as stream:
        value = stream.read(65)  # a signature has 64 bytes; one more would make it wrong
    try:
        key.verify(value, checksums.read_bytes(folder / checksums.FILE))
    except InvalidSignature:
        raise AdvpipeError(
            f"{path}: does not sign {checksums.FILE} with {key_path}: "
            "wrong key, or one of the two files was changed"
        ) from None


def _pem(path: Path) -> bytes:
    try:
        with path.open("rb") as stream:
            return stream.read(_KEY_LIMIT_BYTES)
    except OSError as error:
        raise UsageError(f"{path}: the key cannot be read: {error.strerror or error}") from None


@contextmanager
def _library() -> Iterator[None]:
    try:
        yield
    except ImportError as error:
        line = missing_library_line(error) or f"the library cryptography cannot be loaded: {error}"
        raise NoLibraryError(line) from None

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.dataset import checksums, signature

pytest.importorskip("cryptography")
needs_openssl = pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl")

# The first test vector of RFC 8032, section 7.1, as PKCS #8 and SubjectPublicKeyInfo (RFC 8410) wrap it.
PRIVATE = """-----BEGIN PRIVATE KEY-----
MC4CAQAwBQYDK2VwBCIEIJ1hsZ3v/VpguoRK9JLsLMREScVpezJpGXA7rAMcrn9g
-----END PRIVATE KEY-----
"""
PUBLIC = """-----BEGIN PUBLIC KEY-----
MCowBQYDK2VwAyEA11qYAYKxCrfVS/7TyWQHOg7hcvPapiMlrwIaaPcHURo=
-----END PUBLIC KEY-----
"""
OF_NOTHING = bytes.fromhex(
    "e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e065224901555fb8821590a33bacc61e39701cf9b46b"
    "d25bf5f0595bbe24655141438e7a100b"
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "set"
    folder.mkdir()
    (folder / "a").write_text("1")
    checksums.write(folder)
    (tmp_path / "private.pem").write_text(PRIVATE)
    (tmp_path / "public.pem").write_text(PUBLIC)
    return folder


def openssl(*arguments: object) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(["openssl", *map(str, arguments)], capture_output=True, check=False)


def test_it_signs_as_the_standard_does(tmp_path: Path, folder: Path) -> None:
    (folder / "SHA256SUMS").write_bytes(b"")
    assert signature.sign_folder(folder, tmp_path / "private.pem").read_bytes() == OF_NOTHING
    assert signature.public_pem(signature.load_private_key(tmp_path / "private.pem")).decode() == PUBLIC
    signature.verify_signature(folder, tmp_path / "public.pem")


@pytest.mark.oracle
@needs_openssl
def test_openssl_checks_ours_and_we_check_openssls(tmp_path: Path, folder: Path) -> None:
    private, public = tmp_path / "k.pem", tmp_path / "p.pem"
    openssl("genpkey", "-algorithm", "ed25519", "-out", private)
    openssl("pkey", "-in", private, "-pubout", "-out", public)
    path = signature.sign_folder(folder, private)
    data = folder / "SHA256SUMS"
    check = ("pkeyutl", "-verify", "-rawin", "-pubin", "-inkey", public, "-in", data, "-sigfile", path)
    assert openssl(*check).returncode == 0
    ours = path.read_bytes()
    path.unlink()
    assert openssl("pkeyutl", "-sign", "-rawin", "-inkey", private, "-in", data, "-out", path).returncode == 0
    assert path.read_bytes() == ours
    signature.verify_signature(folder, public)
    data.write_bytes(data.read_bytes() + b"\n")
    assert openssl(*check).returncode != 0
    with pytest.raises(AdvpipeError, match="does not sign SHA256SUMS with"):
        signature.verify_signature(folder, public)


def test_a_flipped_bit_in_any_byte_of_a_signature_is_found(tmp_path: Path, folder: Path) -> None:
    path = signature.sign_folder(folder, tmp_path / "private.pem")
    good = path.read_bytes()
    for place in range(len(good)):
        bad = bytearray(good)
        bad[place] ^= 1 << place % 8
        path.write_bytes(bad)
        with pytest.raises(AdvpipeError):
            signature.verify_signature(folder, tmp_path / "public.pem")
    for bad in (good[:-1], good + b"\0", b""):
        path.write_bytes(bad)
        with pytest.raises(AdvpipeError):
            signature.verify_signature(folder, tmp_path / "public.pem")


def test_without_a_key_the_folders_own_shows_damage(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(AdvpipeError, match="the data set is not signed"):
        signature.verify_signature(folder)
    signature.sign_folder(folder, tmp_path / "private.pem")
    with pytest.raises(AdvpipeError, match="give the signer's public key"):
        signature.verify_signature(folder)
    (folder / signature.KEY_FILE).write_text(PUBLIC)
    signature.verify_signature(folder)


@pytest.mark.oracle
@needs_openssl
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["genpkey", "-algorithm", "ed25519", "-aes256", "-pass", "pass:x"], "is encrypted; decrypt it"),
        (["genpkey", "-algorithm", "x25519"], "is not an Ed25519 key; `openssl genpkey"),
        (["genpkey", "-algorithm", "RSA", "-pkeyopt", "rsa_keygen_bits:2048"], "is not an Ed25519 key"),
        (["ecparam", "-name", "prime256v1", "-genkey", "-noout"], "is not an Ed25519 key"),
    ],
)
def test_other_keys_are_refused(tmp_path: Path, folder: Path, arguments: list[str], message: str) -> None:
    key = tmp_path / "other.pem"
    assert openssl(*arguments, "-out", key).returncode == 0
    with pytest.raises(AdvpipeError, match=message):
        signature.sign_folder(folder, key)
    assert not (folder / "SHA256SUMS.sig").exists()


def test_what_is_no_key_is_refused(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(AdvpipeError, match="is a public key; signing needs the private one"):
        signature.sign_folder(folder, tmp_path / "public.pem")
    with pytest.raises(AdvpipeError, match="cannot be read"):
        signature.sign_folder(folder, tmp_path / "none.pem")
    with pytest.raises(AdvpipeError, match="is not a PEM private key"):
        signature.sign_folder(folder, folder / "a")
    signature.sign_folder(folder, tmp_path / "private.pem")
    with pytest.raises(AdvpipeError, match="is a private key; checking needs the public one"):
        signature.verify_signature(folder, tmp_path / "private.pem")
    with pytest.raises(AdvpipeError, match="is not a PEM public key"):
        signature.verify_signature(folder, folder / "a")


def test_without_the_library_it_says_what_to_install(
    tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "cryptography"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "cryptography", None)
    with pytest.raises(AdvpipeError, match=r"pip install 'advpipe\[sign\]'"):
        signature.sign_folder(folder, tmp_path / "private.pem")

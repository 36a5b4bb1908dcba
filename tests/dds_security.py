"""Keys and permissions of a DDS domain that enforces security, as `ros2 security` makes them for enclaves."""

import subprocess
from pathlib import Path

GOVERNANCE = """<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
 xsi:noNamespaceSchemaLocation="http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_governance.xsd">
<domain_access_rules><domain_rule><domains><id_range><min>0</min><max>230</max></id_range></domains>
<allow_unauthenticated_participants>false</allow_unauthenticated_participants>
<enable_join_access_control>true</enable_join_access_control>
<discovery_protection_kind>ENCRYPT</discovery_protection_kind>
<liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
<rtps_protection_kind>SIGN</rtps_protection_kind>
<topic_access_rules><topic_rule><topic_expression>*</topic_expression>
<enable_discovery_protection>true</enable_discovery_protection>
<enable_liveliness_protection>true</enable_liveliness_protection>
<enable_read_access_control>true</enable_read_access_control>
<enable_write_access_control>true</enable_write_access_control>
<metadata_protection_kind>ENCRYPT</metadata_protection_kind>
<data_protection_kind>ENCRYPT</data_protection_kind>
</topic_rule></topic_access_rules></domain_rule></domain_access_rules></dds>
"""
PERMISSIONS = """<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
 xsi:noNamespaceSchemaLocation="http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_permissions.xsd">
<permissions><grant name="/tester"><subject_name>CN=/tester</subject_name>
<validity><not_before>2020-01-01T00:00:00</not_before><not_after>2099-01-01T00:00:00</not_after></validity>
<allow_rule><domains><id_range><min>0</min><max>230</max></id_range></domains>
<publish><topics><topic>*</topic></topics></publish>
<subscribe><topics><topic>*</topic></topics></subscribe></allow_rule>
<default>DENY</default></grant></permissions></dds>
"""
LIBRARIES = {
    "Authentication": ("auth", "authentication"),
    "Cryptographic": ("crypto", "crypto"),
    "AccessControl": ("ac", "access_control"),
}


def make_enclave(folder: Path) -> Path:
    """The files of an enclave, under the names that ROS 2 gives them."""

    def openssl(*arguments: str) -> None:
        subprocess.run(["openssl", *arguments], cwd=folder, check=True, capture_output=True)

    folder.mkdir(parents=True, exist_ok=True)
    (folder / "governance.xml").write_text(GOVERNANCE)
    (folder / "permissions.xml").write_text(PERMISSIONS)
    curve = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
    authority = (
        "-subj",
        "/CN=authority",
        "-days",
        "3000",
        "-keyout",
        "ca.key",
        "-out",
        "identity_ca.cert.pem",
    )
    openssl("req", "-x509", *curve, *authority)
    openssl("req", *curve, "-subj", "/CN=\\/tester", "-keyout", "key.pem", "-out", "tester.csr")
    signed = ("-CA", "identity_ca.cert.pem", "-CAkey", "ca.key", "-CAcreateserial", "-days", "3000")
    openssl("x509", "-req", "-in", "tester.csr", *signed, "-out", "cert.pem")
    for name in ("governance", "permissions"):
        files = ("-in", f"{name}.xml", "-out", f"{name}.p7s")
        openssl("smime", "-sign", "-text", *files, "-signer", "identity_ca.cert.pem", "-inkey", "ca.key")
    return folder


def security_of(enclave: Path) -> str:
    """The section of Cyclone's configuration that uses an enclave's files."""
    libraries = {
        section: f'<Library path="dds_security_{library}" initFunction="init_{name}" '
        f'finalizeFunction="finalize_{name}"/>'
        for section, (library, name) in LIBRARIES.items()
    }
    ca, home = f"file:{enclave}/identity_ca.cert.pem", f"file:{enclave}"
    return (
        f"<Security><Authentication>{libraries['Authentication']}<IdentityCA>{ca}</IdentityCA>"
        f"<IdentityCertificate>{home}/cert.pem</IdentityCertificate>"
        f"<PrivateKey>{home}/key.pem</PrivateKey></Authentication>"
        f"<Cryptographic>{libraries['Cryptographic']}</Cryptographic>"
        f"<AccessControl>{libraries['AccessControl']}<PermissionsCA>{ca}</PermissionsCA>"
        f"<Governance>{home}/governance.p7s</Governance>"
        f"<Permissions>{home}/permissions.p7s</Permissions></AccessControl></Security>"
    )

"""Seal the files that friso keeps for itself.

An authenticator (HMAC-SHA-256, RFC 2104) with a secret of this user shows that friso wrote a file under exactly this
name. This holds even if others could once write to the folder.
"""

from __future__ import annotations

import hmac
import os
from functools import cache
from pathlib import Path

from filelock import FileLock

from friso.platform.private import read_private, write_private
from friso.platform.system import is_open_to_others

SECRET_FILE, SECRET_BYTES = "secret", 32
"""The file with the secret, and the length [bytes] of it and of an authenticator."""


def write_sealed(path: Path, content: bytes) -> None:
    """Write a file with its authenticator before it, whole or not at all.

    Raises OSError if the file cannot be written.
    """
    write_private(path, _authenticator(path, content) + content)


def read_sealed(path: Path) -> bytes | None:
    """Read the content that `write_sealed` wrote; None if it is missing, damaged or exchanged."""
    try:
        sealed = read_private(path)
    except OSError:
        return None
    authenticator, content = sealed[:SECRET_BYTES], sealed[SECRET_BYTES:]
    return content if hmac.compare_digest(authenticator, _authenticator(path, content)) else None


def _authenticator(path: Path, content: bytes) -> bytes:
    return hmac.digest(_secret(path.parent), path.name.encode() + b"\0" + content, "sha256")


@cache
def _secret(folder: Path) -> bytes:
    """Return the user's secret in a folder, which shows that friso wrote the files there.

    A new one is made if there is none, or if others can have read or written it.
    """
    file = folder / SECRET_FILE
    if (secret := _stored(file)) is None:
        with FileLock(folder / f"{SECRET_FILE}.lock", mode=0o600):
            if (secret := _stored(file)) is None:  # unless another process has made one meanwhile
                secret = os.urandom(SECRET_BYTES)
                write_private(file, secret)
    return secret


def _stored(file: Path) -> bytes | None:
    try:
        secret = read_private(file)
        closed = not is_open_to_others(file.lstat())
    except OSError:
        return None
    return secret if closed and len(secret) == SECRET_BYTES else None

# SPDX-License-Identifier: BSD-3-Clause
"""viser's page as a browser loads it fastest: a short document, a script and a style that the browser keeps.

viser 1.1.1 ships one file. Its script and style, 2.7 MB, are in an attribute of it, compressed with zstd and written in
88 printable characters; code in the page decodes them at each load, and no browser keeps what it compiled of them. Here
they are files of their own, compressed as any browser can read them, under a name with a hash of their content.
"""
from __future__ import annotations

import gzip
import hashlib
import re
from typing import Dict, NamedTuple, Optional, Tuple

import numpy as np
import zstandard

#: The 88 characters: printable ASCII but those that have a meaning in an attribute or a string.
_ALPHABET = "".join(chr(code) for code in range(0x21, 0x7f) if chr(code) not in "\"&<>'`")
_PAYLOAD = re.compile(r'<script data-p="([^"]*)" data-ss="(\d+)" data-cs="(\d+)">')
#: Where viser's script chooses the environment map: its own one while it waits for the server's settings.
_ENVIRONMENT = re.compile(r"(\b[\w$]+===null\?)[\w$]+(:[\w$]+\.hdri_data\b)")
_LARGEST = 1 << 26          # bytes of script and style
_COMPRESSION = 6            # of gzip
#: viser's own loader makes its decoder; then the script may begin.
_START = ("<script type=\"module\">const start = () => { if (globalThis.__viserZstdWasm) { import(\"./%s\"); } "
          "else { setTimeout(start, 1); } }; start();</script>")


class ClientFile(NamedTuple):
    """A file of the page: ``content``, compressed with gzip, and its ``kind`` for HTTP."""

    content: bytes
    kind: str


class ClientPage(NamedTuple):
    """The document and the files that it names."""

    document: str
    files: Dict[str, ClientFile]


def decode(text: str) -> bytes:
    """Return the bytes of a text in 88 characters: 5 of them are 4 bytes, the greatest first.

    Raises
    ------
    ValueError
        If there is another character, or the end is no number of whole bytes.
    """
    table = np.full(256, 255, dtype=np.uint8)
    table[np.frombuffer(_ALPHABET.encode("ascii"), dtype=np.uint8)] = np.arange(len(_ALPHABET))
    digits = table[np.frombuffer(text.encode("latin-1"), dtype=np.uint8)]
    if digits.size and digits.max() >= len(_ALPHABET):
        raise ValueError("a character that is not in the alphabet")
    whole = digits.size // 5
    powers = len(_ALPHABET) ** np.arange(4, -1, -1, dtype=np.uint64)
    groups = digits[:5 * whole].reshape(-1, 5).astype(np.uint64).dot(powers).astype(">u4").tobytes()
    rest = 0
    for digit in digits[5 * whole:].tolist():
        rest = rest * len(_ALPHABET) + digit
    size = max(0, digits.size % 5 - 1)
    if rest >= 256 ** size:
        raise ValueError("characters at the end that are no %d bytes" % size)
    return groups + rest.to_bytes(size, "big")


def split_page(source: str, own: str) -> Optional[ClientPage]:
    """Return viser's page in parts, or None if it is not written as this version writes it.

    Parameters
    ----------
    source : str
        The page that viser ships.
    own : str
        Elements for the end of its body.

    Returns
    -------
    ClientPage or None
    """
    found = _PAYLOAD.search(source)
    body = source.rfind("</body>")
    if found is None or body < found.end():
        return None
    style_size, script_size = int(found.group(2)), int(found.group(3))
    try:
        frame = decode(found.group(1))
        content = zstandard.ZstdDecompressor().decompress(frame, max_output_size=_LARGEST)
    except (ValueError, zstandard.ZstdError):
        return None
    if len(content) != style_size + script_size or not script_size:
        return None
    script = _without_environment(content[style_size:].decode("utf-8")).encode("utf-8")
    style_name, style = _file(content[:style_size], "css", "text/css; charset=utf-8")
    script_name, code = _file(script, "js", "application/javascript; charset=utf-8")
    head = "<link rel=\"stylesheet\" href=\"%s\"><link rel=\"modulepreload\" href=\"%s\">" % (style_name, script_name)
    document = "".join((
        source[:found.start()], head, "<script data-p=\"\" data-ss=\"0\" data-cs=\"0\">", source[found.end():body],
        own, _START % script_name, source[body:]))
    return ClientPage(document, {style_name: style, script_name: code})


def _without_environment(script: str) -> str:
    """Return the script without its own environment map.

    A browser without a GPU would draw with it for some tenths of a second, until the server says that there is none.
    """
    changed, count = _ENVIRONMENT.subn(r"\1null\2", script)
    return changed if count == 1 else script


def _file(content: bytes, ending: str, kind: str) -> Tuple[str, ClientFile]:
    name = "viser-%s.%s" % (hashlib.sha256(content).hexdigest()[:16], ending)
    return name, ClientFile(gzip.compress(content, _COMPRESSION, mtime=0), kind)

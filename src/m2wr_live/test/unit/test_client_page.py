# SPDX-License-Identifier: BSD-3-Clause
"""viser's page in parts: what was in one attribute of it is what the files have."""
import gzip
import os
import re

import pytest
import viser
import zstandard

from m2wr_live.web.client_page import decode, split_page

ALPHABET = [chr(code) for code in range(0x21, 0x7f) if chr(code) not in "\"&<>'`"]
OWN = "<script src=\"live.js\"></script>"
STYLE, SCRIPT = b"a{}", "let t=q===null?own:q.hdri_data;//\u00b5".encode()


def encoded(content):
    """Return bytes in 88 characters, digit by digit."""
    words = []
    for start in range(0, len(content), 4):
        part = content[start:start + 4]
        value, digits = int.from_bytes(part, "big"), []
        for _ in range(len(part) + 1):
            value, digit = divmod(value, 88)
            digits.append(ALPHABET[digit])
        words += reversed(digits)
    return "".join(words)


def page_of(payload, style=len(STYLE), script=len(SCRIPT)):
    return '<html><head><script data-p="%s" data-ss="%d" data-cs="%d">load()</script></head><body></body></html>' % (
        payload, style, script)


def packed():
    return encoded(zstandard.ZstdCompressor().compress(STYLE + SCRIPT))


@pytest.mark.parametrize("size", range(10))
def test_a_text_of_88_characters_is_decoded(size):
    content = bytes((251 * number + 200) % 256 for number in range(size))
    assert decode(encoded(content)) == content


def test_script_and_style_become_files_with_a_hash_in_their_name():
    page = split_page(page_of(packed()), OWN)
    style, script = sorted(page.files, key=lambda name: name[-3:] == ".js")
    assert re.fullmatch(r"viser-[0-9a-f]{16}\.css", style) and re.fullmatch(r"viser-[0-9a-f]{16}\.js", script)
    assert gzip.decompress(page.files[style].content) == STYLE
    assert gzip.decompress(page.files[script].content) == SCRIPT.replace(b"own", b"null")
    assert 'data-p="" data-ss="0" data-cs="0">load()' in page.document
    assert page.document.index(style) < page.document.index("load()") < page.document.index(OWN)
    assert page.document.endswith("</script></body></html>") and page.document.count(script) == 2


@pytest.mark.parametrize("source", [
    "<html><body></body></html>", page_of(encoded(b"no zstd")), page_of(packed(), script=1), page_of("\u20ac"),
    page_of(packed()[:-5]), page_of(packed()).replace("</body>", "")])
def test_a_page_written_in_another_way_is_not_split(source):
    assert split_page(source, OWN) is None


def test_the_page_of_the_installed_viser_is_split():
    path = os.path.join(os.path.dirname(viser.__file__), "client", "build", "index.html")
    with open(path, encoding="utf-8") as stream:
        page = split_page(stream.read(), OWN)
    assert len(page.document) < 100_000
    script = next(gzip.decompress(file.content).decode() for name, file in page.files.items() if name.endswith(".js"))
    assert "===null?null:" in script and len(script) > 1_000_000

#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Makes the pictures of README files and docs/ again, by running the command blocks beside them, without a display.

    tools/gallery.py [DOCUMENT ...]       only the pictures of these, such as docs/5_bug2.md

A comment before a block says which file becomes which picture (test/nodes/doc_blocks.py).  A picture is replaced only
when all blocks before it have run as the document says.
"""
from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from typing import List

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "test", "nodes"))
from PIL import Image  # noqa: E402

from check_docs import environment, work_folder  # noqa: E402
from doc_terminals import run_document  # noqa: E402
from documents import blocks, documents  # noqa: E402

IMAGES = os.path.join(ROOT, "docs", "images")
SMALL = 90000           # bytes; above it a PNG gets a palette


def keep(name: str, path: str) -> None:
    """Copy a picture into docs/images; PNGs are compressed without a visible loss."""
    target = os.path.join(IMAGES, name)
    if name.endswith(".png"):
        with Image.open(path) as picture:
            plain = picture.convert("RGB")
        plain.save(target, optimize=True)
        if os.path.getsize(target) > SMALL:
            plain.quantize(256, method=Image.Quantize.MEDIANCUT if hasattr(Image, "Quantize") else 0,
                           dither=0).save(target, optimize=True)
    else:
        shutil.copyfile(path, target)
    print("%-24s %7d bytes" % (name, os.path.getsize(target)))


def main(chosen: List[str]) -> int:
    """Make the pictures of some documents, or of all; returns the number of documents that failed."""
    unknown = sorted(set(chosen) - set(documents()))
    if unknown:
        sys.exit("gallery: no document %s; there are %s" % (", ".join(unknown), ", ".join(documents())))
    failed, start = 0, time.monotonic()
    os.makedirs(IMAGES, exist_ok=True)
    for path in chosen or documents():
        if not any(block.how is not None and block.how.pictures for block in blocks(path)):
            continue
        print("== gallery: %s" % path, flush=True)
        top = tempfile.mkdtemp(prefix="gallery_")
        try:
            run_document(blocks(path), work_folder(top), environment(top), keep)
        except AssertionError as error:
            print("gallery: %s" % error, file=sys.stderr)
            failed += 1
        finally:
            shutil.rmtree(top, ignore_errors=True)
    print("== gallery: %.0f s, %d documents failed" % (time.monotonic() - start, failed))
    return failed


if __name__ == "__main__":
    sys.exit(min(1, main(sys.argv[1:])))

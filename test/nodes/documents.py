# SPDX-License-Identifier: BSD-3-Clause
"""Which Markdown documents this workspace has, and their blocks."""
import glob
import os

from doc_blocks import blocks_of

ROOT = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
COURSE = ("docs/*.md",)
GUIDES = ("docs/*/*.md",)        # how-to, reference and explanation, each in a folder of that name
READMES = ("README.md", "CONTRIBUTING.md", "src/*/README.md", "dropin/*/README.md", "test/README.md")


def documents(patterns=COURSE + GUIDES + READMES, root=ROOT):
    """Return the paths of documents, relative to the root, in order."""
    return [os.path.relpath(path, root) for pattern in patterns
            for path in sorted(glob.glob(os.path.join(root, pattern)))]


def blocks(path, root=ROOT):
    """Return the blocks of a document; DocumentError if it is not understood."""
    with open(os.path.join(root, path), encoding="utf-8") as stream:
        return blocks_of(stream.read(), path)

# SPDX-License-Identifier: BSD-3-Clause
"""Seeded mutations of bytes, texts and XML trees.

A case is a function of (seed, target, number) only, so any case can be made again without the previous ones.
"""
import copy
import random
import re
import struct

from lxml import etree

#: Numbers that may cause faults: limits of types, text that is not a number, very large, very small, nearly zero.
NUMBERS = ("nan", "inf", "-inf", "0", "-0.0", "-1", "1", "2", "0.5", "1e-320", "1e-30", "1e-9", "1e-6", "1e3", "1e6",
           "1e9",
           "1e12", "1e18", "-1e18", "1e30", "1e200", "1e308", "-1e308", "1e309", "255", "256", "65536", "2147483647",
           "2147483648", "-2147483648", "4294967295", "4294967296", "9223372036854775808", "3.14159", "-1.5708",
           "0x10", "1,5", "1_000", "١٢", "", " ", "abc", "${1+1}", "$(env HOME)", "1 2 3", "0 0 0 0 0 0",
           "9" * 400, "0." + "0" * 400 + "1")
FLOATS = (float("nan"), float("inf"), float("-inf"), 0.0, -0.0, 5e-324, -1e-30, 1e-9, 1e-6, 0.01, 0.5, 1.0, -1.0, 3.0,
          10.0,
          -100.0, 1e3, 1e4, -1e6, 1e9, 1e12, 1e18, -1e18, 1e30, 1e100, 1.7e308, -1.7e308)
WORDS = ("", "world", "default", "link", "base_link", "map", "::", "a::b::c", "/", "//", "..", "../../etc/passwd",
         "%s%n",
         "package://nowhere/x.stl", "model://nowhere", "file:///dev/zero", "/dev/urandom", "\u202e", "x" * 3000,
         "ü" * 300,
         "0", "true", "-", "~", "$(find m2wr_sim)", "<", "&amp;", "__reserved__")
INTEGERS = (0, 1, 2, 4, 127, 128, 255, 65535, 65536, 0x7fffffff, 0x80000000, 0xfffffffe, 0xffffffff)
_TOKEN = re.compile(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?|\w+|[^\w\s]")
_LONGEST = 60000            # bytes of a case: cost must come from the contents of an input, not from its length


def generator(seed, target, number):
    """Return the ``random.Random`` of one case; the same on every machine and Python."""
    return random.Random("%d/%s/%d" % (seed, target, number))


def change_bytes(rng, data, others=()):
    """Return ``data`` (bytes) with one to eight changes; ``others`` (bytes) give pieces to splice in."""
    data = bytearray(data)
    for _ in range(1 + int(rng.expovariate(0.8)) % 8):
        size = len(data)
        at = rng.randrange(size + 1)
        kind = rng.randrange(9)
        if kind == 0 and size:
            data[at % size] ^= 1 << rng.randrange(8)
        elif kind == 1 and size:
            data[at % size] = rng.choice((0, 1, 9, 10, 32, 45, 48, 60, 127, 128, 255))
        elif kind == 2:
            del data[at:at + 1 + int(rng.expovariate(0.05))]
        elif kind == 3:
            piece = data[at:at + 1 + int(rng.expovariate(0.05))]
            data[at:at] = piece * rng.choice((1, 2, 30))
        elif kind == 4:
            data[at:at] = bytes(rng.randrange(256) for _ in range(rng.randrange(1, 12)))
        elif kind == 5:
            del data[at:]
        elif kind == 6 and others:
            other = rng.choice(others)
            start = rng.randrange(len(other) + 1)
            data[at:at + rng.randrange(20)] = other[start:start + int(rng.expovariate(0.02))]
        elif kind == 7:
            data[at:at + 4] = struct.pack("<I", rng.choice(INTEGERS))
        else:
            data[at:at + 8] = struct.pack("<d", rng.choice(FLOATS))
    return bytes(data[:_LONGEST])


def change_text(rng, text, words=WORDS):
    """Return ``text`` with one to five of its words, numbers, signs or lines replaced, duplicated or removed."""
    for _ in range(1 + rng.randrange(5)):
        kind = rng.randrange(6)
        if kind == 0:
            lines = text.split("\n")
            line = rng.randrange(len(lines))
            if rng.randrange(2):
                lines.insert(rng.randrange(len(lines) + 1), lines[line])
            else:
                del lines[line]
            text = "\n".join(lines)
            continue
        found = [(match.start(), match.end()) for match in _TOKEN.finditer(text)]
        if not found:
            return text + rng.choice(words)
        start, end = rng.choice(found)
        if kind <= 2:
            new = rng.choice(NUMBERS)
        elif kind == 3:
            new = rng.choice(words)
        elif kind == 4:
            other = rng.choice(found)
            new = text[other[0]:other[1]]
        else:
            new = ""
        text = text[:start] + new + text[end:]
    return text[:_LONGEST]


def number(rng):
    """Return the text of a number: an ordinary one as often as one of :data:`NUMBERS`."""
    return "%.6g" % rng.uniform(-3.0, 3.0) if rng.randrange(2) else rng.choice(NUMBERS)


def change_numbers(rng, text):
    """Return a text of blank-separated numbers with one of them changed, or too many, or too few."""
    parts = text.split()
    if not parts or rng.randrange(6) == 0:
        return number(rng)
    at = rng.randrange(len(parts))
    kind = rng.randrange(8)
    if kind == 0:
        del parts[at]
    elif kind == 1:
        parts.insert(at, number(rng))
    else:
        parts[at] = number(rng)
    return " ".join(parts)


class Trees:
    """Changes XML documents as trees, so that they remain well-formed.

    Parameters
    ----------
    documents : list of str
        Of one kind; elements are copied from one to another.
    """

    def __init__(self, documents):
        self.documents = documents
        self._roots = [etree.fromstring(text.encode()) for text in documents]
        nodes = [node for root in self._roots for node in root.iter(etree.Element)]
        self._tags = sorted({node.tag for node in nodes if isinstance(node.tag, str)})
        self._attributes = sorted({name for node in nodes for name in node.attrib})
        self._values = sorted({value for node in nodes for value in node.attrib.values()} | {
            node.text.strip() for node in nodes if node.text and len(node.text.strip()) < 80})
        self._donors = [node for node in nodes if len(etree.tostring(node)) < 3000 and node.getparent() is not None]

    def change(self, rng):
        """Return a changed document (str)."""
        number_of_changes = 1 + int(rng.expovariate(0.6)) % 12
        root = copy.deepcopy(rng.choice(self._roots))
        for _ in range(number_of_changes):
            nodes = [node for node in root.iter(etree.Element)]
            self._one(rng, root, rng.choice(nodes))
        text = etree.tostring(root).decode()
        if rng.randrange(12) == 0:
            text = change_text(rng, text)
        if rng.randrange(60) == 0:
            text = _PROLOGS[rng.randrange(len(_PROLOGS))] + text
        return text if len(text) < _LONGEST else text[:_LONGEST]

    def _one(self, rng, root, node):
        parent, kind = node.getparent(), rng.randrange(20)
        if kind < 8:
            self._new_value(rng, node)
        elif kind == 8 and parent is not None:
            parent.remove(node)
        elif kind == 9 and parent is not None:
            parent.insert(rng.randrange(len(parent) + 1), copy.deepcopy(node))
        elif kind == 10:
            node.insert(rng.randrange(len(node) + 1), copy.deepcopy(rng.choice(self._donors)))
        elif kind == 11 and parent is not None:
            parent.replace(node, copy.deepcopy(rng.choice(self._donors)))
        elif kind == 12:
            node.tag = rng.choice(self._tags)
        elif kind == 13 and node.attrib:
            del node.attrib[rng.choice(sorted(node.attrib))]
        elif kind == 14:
            node.set(rng.choice(self._attributes), rng.choice(self._values + [number(rng)]))
        elif kind == 15 and len(node) > 1:
            children = list(node)
            rng.shuffle(children)
            node[:] = children
        elif kind == 16 and rng.randrange(8) == 0:
            inner = node
            for _ in range(rng.choice((3, 60, 400))):
                inner = etree.SubElement(inner, node.tag)
        elif kind == 17 and parent is not None and rng.randrange(4) == 0 and len(etree.tostring(node)) < 400:
            for _ in range(rng.choice((5, 40))):
                parent.append(copy.deepcopy(node))
        else:
            self._new_value(rng, node)

    def _new_value(self, rng, node):
        """Change an attribute or the text: numbers mostly to numbers."""
        names = sorted(node.attrib)
        if names and rng.randrange(3):
            name = rng.choice(names)
            node.set(name, self._other(rng, node.get(name)))
        elif len(node) == 0:
            node.text = self._other(rng, node.text or "")

    def _other(self, rng, value):
        kind = rng.randrange(10)
        if kind < 6:
            return _legal(change_numbers(rng, value)) if _is_numeric(value) else rng.choice(self._values)
        if kind < 8:
            return rng.choice(self._values)
        return _legal(rng.choice(WORDS if kind == 8 else NUMBERS))


_PROLOGS = ('<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>', "<?xml version='1.0'?>", "\ufeff",
            "\n \n",
            "<?xml version='1.0' encoding='utf-16'?>", "<!-- a -- b -->", "<!--" + "<" * 200, "<?x?>" * 50,
            '<!DOCTYPE x SYSTEM "file:///etc/passwd">', "<!-- -->" * 30, "<!DOCTYPE " * 20)


def _is_numeric(value):
    parts = value.split()
    try:
        return bool(parts) and [float(part) for part in parts] is not None
    except ValueError:
        return False


def _legal(text):
    return "".join(letter for letter in text if letter in "\t\n\r" or " " <= letter <= "\ud7ff")


# ---- reduction of a failing case ---------------------------------------------------------------------------------

def smaller_sequences(case):
    """Yield shorter versions of a list, bytes or str: without halves, quarters and so on."""
    size = len(case)
    piece = size // 2
    while piece >= 1:
        for start in range(0, size, piece):
            yield case[:start] + case[start + piece:]
        piece //= 2


def smaller_trees(text):
    """Yield versions of an XML document with one element, attribute or word less; for other texts, shorter texts."""
    try:
        root = etree.fromstring(text.encode())
    except (etree.XMLSyntaxError, ValueError):
        for shorter in smaller_sequences(text):
            yield shorter
        return
    count = sum(1 for _ in root.iter(etree.Element))
    for index in range(1, count):
        other = copy.deepcopy(root)
        node = list(other.iter(etree.Element))[index]
        node.getparent().remove(node)
        yield etree.tostring(other).decode()
    for index in range(count):
        for name in sorted(list(root.iter(etree.Element))[index].attrib):
            other = copy.deepcopy(root)
            del list(other.iter(etree.Element))[index].attrib[name]
            yield etree.tostring(other).decode()

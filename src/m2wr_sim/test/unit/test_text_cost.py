"""What reading costs grows with its input's length and no faster: nobody stops the clock with a short text.

Cost is what Python executes, counted, plus the least CPU time of several tries for what runs in C.
"""
import time

import pytest

from m2wr_sim.errors import SimError
from m2wr_sim.model.lenient_xml import root_tag, tidy, without_comments
from m2wr_sim.model.sdf import load_sdf
from m2wr_sim.model.urdf import load_urdf

LEAST = 0.02            # CPU time below which a ratio of two says nothing [s]
MOST = 5.0              # CPU time that a text of LONG characters may take [s]
LONG = 250000
GROWTH = 3.0            # of the cost when the length doubles: 2 for what is linear, 4 for what is quadratic
READERS = {
    "root_tag": root_tag, "without_comments": without_comments, "tidy": lambda text: tidy(text.encode()),
    "urdf": lambda text: load_urdf(text, "a.urdf"), "sdf": lambda text: load_sdf(text, "a.sdf")}
PIECES = [
    "<?xml ", "<?xml ?>", "<?a?>", "<?", "<!--", "<!---->", "<!-- - --", "<!DOCTYPE ", "<!DOCTYPE a []>",
    "<!DOCTYPE a [", " ", "\n", "\ufeff", "&", "&a", "&#1", "<", "<a", "<a>", "<a/>", "<a:b", "<a:b ", "a:", ":", "a",
    " a:b=''",
    "xmlns:a=''", "<robot>", "<link name='a'/>", "<![CDATA[", "]]>", "package://", "<?xml -- ><!--", "</a>",
    "<gazebo/>",
    "'", "\"", "\0"]
HEADS = {"urdf": ["<robot name='r'>"], "sdf": ["<sdf version='1.6'><model name='m'>"]}
ANY_HEADS = ["", "<?xml version='1.0'?>", "<!-- ", "<?xml "]


def cost(read, text, tries=3):
    """Return the least CPU time of some tries [s]."""
    best = float("inf")
    for _ in range(tries):
        begin = time.thread_time()
        try:
            read(text)
        except SimError:
            pass
        best = min(best, time.thread_time() - begin)
        if best < LEAST:
            break
    return best


def check_growth(read, make, least=2000, most=LONG):
    """Double a text until it costs something, then hold its growth and what the longest one would take."""
    length = least
    while length < most:
        one = cost(read, make(length))
        if one > LEAST:
            two = cost(read, make(2 * length))
            assert two < GROWTH * one, "{} characters {:.3f} s, twice as many {:.3f} s".format(length, one, two)
            assert one * most / length < MOST, "{:.3f} s for {} characters".format(one, length)
            return
        length *= 4


@pytest.mark.parametrize("name", sorted(READERS))
def test_cost_grows_with_length_for_every_piece_repeated(name):
    for head in HEADS.get(name, ANY_HEADS):
        for piece in PIECES:
            try:
                check_growth(READERS[name], lambda length: head + piece * (length // len(piece)))
            except AssertionError as error:
                raise AssertionError("{!r} + {!r} ...: {}".format(head, piece, error))


def test_many_prefixes_cost_no_more_than_their_length():
    check_growth(READERS["tidy"], lambda length: "".join("<p%d:a " % k for k in range(length // 8)))


def test_the_texts_that_stopped_the_clock():
    for text in ("<?" + "<?>?><!---->" * 15, "<!---->" * 3 + "<?a?>" * 20 + "<!--" + "--><!--" * 20,
                 "<?" + "?><?" * 30, "<?xml " * 40000, "\n<?xml " + "<?xml" * 48000,
                 "<!DOCTYPE" + "[]" * 1000 + "<!DOCTYPE []>" * 30):
        for read in READERS.values():
            assert cost(read, text, 1) < 1.0

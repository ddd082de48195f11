"""What was read but not used: one sentence a subject, so that nothing is ignored in silence."""
from lxml import etree

from m2wr_sim.model.safe_xml import line_of


class Notes:
    """Collects sentences; the same subject is told once, with the first place where it stood."""

    def __init__(self):
        self._subjects = set()
        self._sentences = []

    def add(self, sentence, subject=None):
        """Add a sentence unless its ``subject`` (by default the sentence itself) was told before."""
        key = sentence if subject is None else subject
        if key not in self._subjects:
            self._subjects.add(key)
            self._sentences.append(sentence)

    def unread(self, element, read, silent=()):
        """Note every child of ``element`` that is neither in ``read`` nor in ``silent``, once for each tag.

        Parameters
        ----------
        element : lxml element
            Its own tag and the child's tag make up the subject.
        read, silent : containers of str
            Tags that are used, and tags that have no part in the simulation (colours, window layout, ...).
        """
        for child in element:
            tag = child.tag
            if tag in read or tag in silent:
                continue
            parent, name = etree.QName(element).localname, etree.QName(child).localname
            self.add("{}: <{}> in <{}> is not read.".format(line_of(child), name, parent), ("unread", parent, tag))

    def sentences(self):
        """Return the sentences in the order they came, as a tuple."""
        return tuple(self._sentences)

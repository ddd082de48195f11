# SPDX-License-Identifier: BSD-3-Clause
"""What was read but not used: one sentence a subject, so that nothing is ignored in silence.

Four degrees: a *fault* made something be left out.  A *note* is worth a warning, for the model does not do what its
author sees it do in Gazebo.  An *aside* tells of what Gazebo does not apply either, or of what is applied here beyond
that.  A *remark* names what belongs to viewers or other programs and is gathered into one quiet sentence.
"""
from lxml import etree

from m2wr_sim.model.xml.safe import XmlError, file_of

MOST_SENTENCES = 1000       # of one document; each becomes a line of the log


class Notes:
    """Collects sentences; the same subject is told once, with the first place where it stood."""

    def __init__(self):
        self._subjects = set()
        self._sentences = []
        self._faults = []
        self._asides = []
        self._quiet = {}
        self._untold = 0

    def add(self, sentence, subject=None):
        """Add a sentence unless its ``subject`` (by default the sentence itself) was told before."""
        key = sentence if subject is None else subject
        if key not in self._subjects:
            self._subjects.add(key)
            if len(self._sentences) < MOST_SENTENCES:
                self._sentences.append(sentence)
            else:
                self._untold += 1

    def aside(self, sentence, subject):
        """Add a sentence that is worth no warning, unless its ``subject`` was told before."""
        if subject not in self._subjects:
            self._subjects.add(subject)
            self._asides.append(sentence)

    def remark(self, element, holder):
        """Note that ``element``, which stands in a ``holder`` (``<world>``), has no part in the simulation."""
        name = etree.QName(element).localname
        if (holder, name) not in self._quiet:
            self._quiet[holder, name] = (file_of(element), element.sourceline)

    def attempt(self, part, function, *arguments, subject=None):
        """Call ``function(*arguments)`` to read a part; where that cannot be read, it is left out and told.

        Parameters
        ----------
        part : str
            What is left out then: ``this collision``.
        subject : hashable, optional
            See :meth:`add`.

        Returns
        -------
        object or None
            What the function returns; None where it raised an XmlError.
        """
        try:
            return function(*arguments)
        except XmlError as error:
            self._faults.append(error)
            self.add("{}; {} is left out.".format(error, part), subject)
            return None

    def sentences(self):
        """Return the sentences in the order they came, as a tuple."""
        more = ("{} more things are not told.".format(self._untold),) if self._untold else ()
        return tuple(self._sentences) + more

    def faults(self):
        """Return the errors of the parts that were left out, as a tuple."""
        return tuple(self._faults)

    def remarks(self):
        """Return the asides, and the one sentence about what has no part in the simulation, as a tuple."""
        if not self._quiet:
            return tuple(self._asides)
        files = {}
        for (holder, name), (file, line) in self._quiet.items():
            files.setdefault(file, []).append("<{}> in {} (line {})".format(name, holder, line))
        return tuple(self._asides) + ("; ".join("{}: without effect on the simulation: {}".format(
            file, ", ".join(told)) for file, told in files.items()) + ".",)

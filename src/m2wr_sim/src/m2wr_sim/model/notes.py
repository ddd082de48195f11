# SPDX-License-Identifier: BSD-3-Clause
"""Messages about elements of a description that are ignored: one sentence for each subject.

There are four levels.  A *fault*: a part was left out.  A *note* becomes a warning, because Gazebo treats the element
differently.  An *aside* becomes an info: Gazebo ignores the element too, or only this simulator applies it.
*Remarks* about elements for viewers and other programs are collected in one sentence.
"""
from __future__ import annotations

from typing import Any, Callable, Dict, Hashable, List, Optional, Set, Tuple

from lxml import etree

from m2wr_sim.model.xml.safe import XmlError, file_of

MOST_SENTENCES = 1000       # of one document; each becomes a line of the log


class Notes:
    """Collects sentences; each subject is reported once, with its first place in the document."""

    def __init__(self) -> None:
        self._subjects: Set[Hashable] = set()
        self._sentences: List[str] = []
        self._faults: List[XmlError] = []
        self._asides: List[str] = []
        self._ignored: Dict[Tuple[str, str], Tuple[str, int]] = {}
        self._dropped = 0

    def add(self, sentence: str, subject: Optional[Hashable] = None) -> None:
        """Add a warning, unless its subject was reported before.

        Parameters
        ----------
        sentence : str
        subject : hashable, optional
            By default the sentence.
        """
        key = sentence if subject is None else subject
        if key not in self._subjects:
            self._subjects.add(key)
            if len(self._sentences) < MOST_SENTENCES:
                self._sentences.append(sentence)
            else:
                self._dropped += 1

    def size(self) -> Tuple[int, int, int]:
        """Return the numbers of subjects, faults and elements without effect; if equal, nothing was added."""
        return len(self._subjects), len(self._faults), len(self._ignored)

    def aside(self, sentence: str, subject: Hashable) -> None:
        """Add a sentence for level info, unless its subject was reported before.

        Parameters
        ----------
        sentence : str
        subject : hashable
        """
        if subject not in self._subjects:
            self._subjects.add(subject)
            self._asides.append(sentence)

    def remark(self, element: Any, holder: str) -> None:
        """Record an element without effect on the simulation.

        Parameters
        ----------
        element : lxml element
        holder : str
            Its parent, for the message: ``<world>``.
        """
        name = etree.QName(element).localname
        if (holder, name) not in self._ignored:
            self._ignored[holder, name] = (file_of(element), element.sourceline)

    def attempt(self, part: str, function: Callable[..., Any], *arguments: Any,
                subject: Optional[Hashable] = None) -> Any:
        """Call a function to read a part of the document; a part that cannot be read is left out with a warning.

        Parameters
        ----------
        part : str
            Name of the part for the message: ``this collision``.
        function : callable
        *arguments : object
            Of the function.
        subject : hashable, optional
            See :meth:`add`.

        Returns
        -------
        object or None
            The function's result; None if it raised an XmlError.
        """
        try:
            return function(*arguments)
        except XmlError as error:
            self._faults.append(error)
            self.add("{}; {} is left out.".format(error, part), subject)
            return None

    def sentences(self) -> Tuple[str, ...]:
        """Return the warnings in the order in which they were added."""
        more = ("{} more warnings are not shown.".format(self._dropped),) if self._dropped else ()
        return tuple(self._sentences) + more

    def faults(self) -> Tuple[XmlError, ...]:
        """Return the errors of the parts that were left out."""
        return tuple(self._faults)

    def remarks(self) -> Tuple[str, ...]:
        """Return the asides, and one sentence about all elements without effect on the simulation."""
        if not self._ignored:
            return tuple(self._asides)
        files: Dict[str, List[str]] = {}
        for (holder, name), (file, line) in self._ignored.items():
            files.setdefault(file, []).append("<{}> in {} (line {})".format(name, holder, line))
        return tuple(self._asides) + ("; ".join("{}: without effect on the simulation: {}".format(
            file, ", ".join(names)) for file, names in files.items()) + ".",)

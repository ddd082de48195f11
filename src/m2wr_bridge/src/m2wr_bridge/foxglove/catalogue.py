# SPDX-License-Identifier: BSD-3-Clause
"""What can be subscribed to and called, with the ids under which clients know it."""
from __future__ import annotations

import itertools
from typing import Any, Dict, List, NamedTuple, Tuple


class Channel(NamedTuple):
    """A topic: ``schema`` is the definition of its type with all types in it."""

    id: int
    topic: str
    type_name: str
    schema: str

    def fields(self) -> Dict[str, Any]:
        """Return what a client is told."""
        return {"id": self.id, "topic": self.topic, "encoding": "ros1", "schemaName": self.type_name,
                "schema": self.schema, "schemaEncoding": "ros1msg"}


class Service(NamedTuple):
    """A service with the definitions of request and response."""

    id: int
    name: str
    type_name: str
    request: str
    response: str

    def fields(self) -> Dict[str, Any]:
        """Return what a client is told. The older `requestSchema` makes Lichtblick warn of every service."""
        def part(name: str, schema: str) -> Dict[str, str]:
            return {"encoding": "ros1", "schemaName": self.type_name + name, "schemaEncoding": "ros1msg",
                    "schema": schema}
        return {"id": self.id, "name": self.name, "type": self.type_name, "request": part("_Request", self.request),
                "response": part("_Response", self.response)}


class Changes(NamedTuple):
    """What has appeared, as fields, and the ids of what has gone."""

    channels: List[Dict[str, Any]]
    lost_channels: List[int]
    services: List[Dict[str, Any]]
    lost_services: List[int]


class Catalogue:
    """All channels and services; an id is never used again."""

    def __init__(self) -> None:
        self.channels: Dict[int, Channel] = {}
        self.services: Dict[int, Service] = {}
        self._ids = itertools.count(1)

    def update(self, topics: Dict[str, Tuple[str, str]], services: Dict[str, Tuple[str, str, str]]) -> Changes:
        """Take what there is; return what has changed.

        Parameters
        ----------
        topics : dict
            {topic: (type, definition)}
        services : dict
            {service: (type, definition of the request, of the response)}

        Returns
        -------
        Changes
        """
        here = {(one.topic, one.type_name, one.schema): one.id for one in self.channels.values()}
        wanted = {(name,) + value for name, value in topics.items()}
        served = {(one.name, one.type_name, one.request, one.response): one.id for one in self.services.values()}
        asked = {(name,) + value for name, value in services.items()}
        lost = [number for key, number in here.items() if key not in wanted]
        gone = [number for key, number in served.items() if key not in asked]
        new = [Channel(next(self._ids), *key) for key in sorted(wanted) if key not in here]
        offered = [Service(next(self._ids), *key) for key in sorted(asked) if key not in served]
        # new dictionaries: sessions read them in other threads
        self.channels = {**{number: one for number, one in self.channels.items() if number not in lost},
                         **{one.id: one for one in new}}
        self.services = {**{number: one for number, one in self.services.items() if number not in gone},
                         **{one.id: one for one in offered}}
        return Changes([one.fields() for one in new], lost, [one.fields() for one in offered], gone)

    def everything(self) -> Changes:
        """Return all as if it had just appeared, for a new client."""
        return Changes([one.fields() for one in self.channels.values()], [],
                       [one.fields() for one in self.services.values()], [])

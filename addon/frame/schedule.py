"""When a picture's samples are drawn and which are shown: what each part of it may do is told by one of these facts."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Schedule:
    """Of one picture. `known_total`: how many samples it has is known when it begins, and their mean alone counts, so
    that a sample may leave out what others bring. `shows_each`: it is shown as it grows. `may_measure`: a first look at
    the scene, to share samples out, is worth its time. `may_rebuild`: so is making anew what still serves of pictures
    before, or what nobody waits for. `has_passes`: render passes are made of it. `is_draft`: it is one of a moment, in
    coarse pixels, for which parameters are at most what they declare."""

    known_total: bool = False
    shows_each: bool = True
    may_measure: bool = False
    may_rebuild: bool = False
    has_passes: bool = False
    is_draft: bool = False

    def as_draft(self) -> Schedule:
        """The same for a view that moves, or a preview: a picture by itself."""
        return replace(self, shows_each=False, is_draft=True)


AT_REST = Schedule()  # a viewport that holds still
DRAFT = AT_REST.as_draft()  # one that moves
FINAL = Schedule(True, False, True, True, True)  # final renders and bakes

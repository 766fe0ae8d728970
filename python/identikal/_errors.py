"""What goes wrong, as exceptions and warnings."""

import re


class InputError(ValueError):
    """A mistake in arguments, model or data. path, line, column: where, as far as it is known."""

    def __init__(self, message):
        super().__init__(message)
        place = re.match(r"(?P<path>[^:\n]+):(?P<line>\d+):(?:(?P<column>\d+):)? ", message)
        self.path = place["path"] if place else None
        self.line = int(place["line"]) if place else None
        self.column = int(place["column"]) if place and place["column"] else None


class IdentikalError(RuntimeError):
    """An internal error, or a file that cannot be written."""


class FindingWarning(UserWarning):
    """What a job found in a recording, a model or an estimate: the findings of a result that are no notes."""


class StoppedWarning(UserWarning):
    """A job was stopped by Ctrl-C or by its progress function; the result is the best so far."""

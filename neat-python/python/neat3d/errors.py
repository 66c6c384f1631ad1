"""What can go wrong, by the exit code that the command ``neat`` has for it.

The sentences are those of the command.
"""

from __future__ import annotations

__all__ = ["InputError", "Interrupted", "NeatError", "NeatWarning", "RunError"]


class NeatError(Exception):
    """Something that was asked for was not done."""

    exit_code = 1


class RunError(NeatError):
    """The work failed: a full disk, a device, an optimisation that diverged. Exit code 1."""


class InputError(NeatError, ValueError):
    """Arguments or input that cannot be used; trying again without a change is pointless.
    Exit code 2."""

    exit_code = 2


class Interrupted(KeyboardInterrupt):
    """Ctrl-C ended a run after its current step; what was done is on disk, and ``resume=True``
    continues it. Exit code 130. Not a :class:`NeatError`: what catches errors must not swallow
    a person's wish to stop."""

    exit_code = 130


class NeatWarning(UserWarning):
    """Something that a person should know and that stops nothing."""

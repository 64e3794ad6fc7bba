"""What a user reads when something is wrong: one message and an exit status, never a traceback."""

from __future__ import annotations

import warnings


class LightdepthError(Exception):
    """A problem that the program explains to its user in one message.

    Attributes:
        exit_status: the process's exit status when the command line meets this error.
    """

    exit_status = 1


class InputError(LightdepthError):
    """Bad input. The message names the file, the place in it, what was found and what is allowed."""

    exit_status = 2


class SetupError(LightdepthError):
    """Something that must be installed is missing or too old. The message says what to install."""

    exit_status = 2


class InputWarning(UserWarning):
    """Something in a file was not applied, or was guessed, so that the picture may differ from what was meant."""


def warn(message: str) -> None:
    """Report what a file holds that was not applied, or was guessed; the command line prints it as a warning.

    Args:
        message: names the file, the place in it, what was found and what is done about it.
    """
    warnings.warn(message, InputWarning, stacklevel=2)

"""What a user's code raised, in a line for the report."""

from hsp_control.common.exceptions import HspControlError


def described(error: BaseException) -> str:
    """Return an exception's message; of foreign exceptions, with their type.

    It never raises: the message of a foreign exception may itself fail.
    """
    name = type(error).__name__
    try:
        message = str(error)
    except Exception:
        return name
    if isinstance(error, HspControlError | OSError) and message:
        return message
    return f"{name}: {message}" if message else name

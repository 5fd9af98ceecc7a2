"""A parser that suggests what was meant, and complains with the command's own usage."""

import argparse
import re
from collections.abc import Sequence
from typing import Any, NoReturn

from hsp_control.common.suggestions import did_you_mean


class Parser(argparse.ArgumentParser):
    """An `argparse.ArgumentParser` for commands and for their options."""

    def __init__(self, *args: Any, **options: Any) -> None:
        """Take options by their full names: ``--st`` is no ``--strict``."""
        super().__init__(*args, **{"allow_abbrev": False, **options})

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: Any = None
    ) -> tuple[Any, list[str]]:
        """Parse, and refuse here what a command does not know."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            options = [name for name in unknown if name.startswith("-")]
            name = (options or unknown)[0]
            known = self._option_string_actions
            hint = did_you_mean(name.split("=")[0], known) if options else ""
            self.error(f"there is no {name!r} here{hint}")
        return found, unknown

    def error(self, message: str) -> NoReturn:
        """Print the message and exit with 2; a mistyped command is guessed."""
        mistyped = re.search(r"argument COMMAND: invalid choice: '(.*?)'", message)
        if mistyped is not None:
            commands = next(
                action.choices
                for action in self._actions
                if isinstance(action, argparse._SubParsersAction)
            )
            name = mistyped[1]
            message = (
                f"there is no command {name!r}{did_you_mean(name, commands)}; "
                "hsp --help lists all"
            )
        super().error(message)

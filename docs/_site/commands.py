"""The page of all commands, made of the parser of the command line."""

import argparse

from prose import plain


def commands_page(parser: argparse.ArgumentParser) -> str:
    """Return the page: each command with its usage and its options."""
    lines = ["# Commands", "", str(parser.description), ""]
    [children] = [
        a for a in parser._actions if isinstance(a, argparse._SubParsersAction)
    ]
    for choice in children._choices_actions:
        command = children.choices[choice.dest]
        lines += [
            f"## hsp {choice.dest}",
            "",
            f"{command.description or choice.help}",
            "",
        ]
        usage = command.format_usage().removeprefix("usage: ")
        lines += ["```text", usage.strip(), "```", ""]
        rows = [_option(action) for action in command._actions if action.help]
        lines += ["| | |", "|---|---|", *(row for row in rows if row), ""]
        if command.epilog:
            lines += [command.epilog, ""]
    return "\n".join(lines)


def _option(action: argparse.Action) -> str:
    if action.help == argparse.SUPPRESS or isinstance(action, argparse._HelpAction):
        return ""
    value = action.metavar or (action.dest.upper() if action.nargs != 0 else "")
    if isinstance(value, tuple):
        value = " ".join(value)
    names = [
        f"{o} {value}".strip() if action.nargs != 0 else o
        for o in action.option_strings
    ]
    said = (action.help or "").replace("%%", "%")
    said = said.replace("%(default)s", str(action.default))
    name = (", ".join(names) or value).replace("|", "\\|")
    return f"| `{name}` | {plain(said)} |"

"""Help texts."""

import typer
from rich.text import Text

from lightdepth.cli.app import app


def commands(command):
    yield command
    for inner in getattr(command, "commands", {}).values():
        yield from commands(inner)


def test_brackets_are_shown_and_not_taken_for_markup():
    texts = []
    for command in commands(typer.main.get_command(app)):
        texts += [command.help, *(getattr(parameter, "help", None) for parameter in command.params)]
    texts = [text for text in texts if text]
    assert len(texts) > 100
    for text in texts:
        assert Text.from_markup(text).plain == text.replace("\\[", "[")

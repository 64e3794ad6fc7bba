"""Runs of the real command."""

import sys

import pytest

from lightdepth.cli.app import main


@pytest.fixture
def command(monkeypatch, capsys):
    """Run `lightdepth` with arguments; gives exit status, standard output and standard error."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["lightdepth", *map(str, arguments)])
        monkeypatch.setenv("COLUMNS", "1000")
        with pytest.raises(SystemExit) as stop:
            main()
        captured = capsys.readouterr()
        return stop.value.code or 0, captured.out, captured.err

    return run

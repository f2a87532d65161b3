"""The command line: reads arguments, calls the library, and has ``terminal`` show the answer.

``program`` names the commands and turns errors into exit codes; each command is a file of its own;
``options`` are those that several share. Nothing heavy is imported before a command runs.
"""

from fgnav.cli.program import main

__all__ = ["main"]

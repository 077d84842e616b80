"""Runs `choreograph` as a user does, and checks how it fails."""

from click.testing import CliRunner, Result

from choreograph.cli.main import main


def run(*arguments: object) -> Result:
    """The result of `choreograph ARGUMENTS`."""
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def assert_one_line(result: Result, *, says: str) -> None:
    """Exit status 2, and one line on stderr that says what was wrong."""
    assert result.exit_code == 2, result.output
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1, result.stderr
    assert says in lines[0]
    assert "Traceback" not in result.output

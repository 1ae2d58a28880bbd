"""Sessions of nox: the commands of README.md, docs/contributing.md and .ci/run, none of its own."""

import nox

nox.options.sessions = ["lint", "tests"]
PYTHONS = ["3.11", "3.12", "3.13", "3.14"]


@nox.session(python=PYTHONS)
def tests(session: nox.Session) -> None:
    """Run the tests of less than ten seconds, as README.md does."""
    session.install(".[test]")
    session.run("pytest", *session.posargs)


@nox.session
def slow(session: nox.Session) -> None:
    """Run all tests, those of more than ten seconds too."""
    session.install(".[test]")
    session.run("pytest", "-m", "slow or not slow", *session.posargs)


@nox.session(venv_backend="none")
def lint(session: nox.Session) -> None:
    """Run the linters, of the pinned versions."""
    session.run(".ci/run", "lint", external=True)


@nox.session(venv_backend="none")
def wheel(session: nox.Session) -> None:
    """Build the wheel and use it in an environment without a compiler."""
    session.run(".ci/run", "wheel", external=True)


@nox.session
def docs(session: nox.Session) -> None:
    """Build the pages, as the head of docs/conf.py says."""
    session.install(".[docs]")
    session.run("sphinx-build", "-W", "docs", "docs/_build")


@nox.session
def links(session: nox.Session) -> None:
    """Ask for every address that the pages link to; tests and `docs` look at links among pages."""
    session.install(".[docs]")
    session.run("sphinx-build", "-b", "linkcheck", "docs", "docs/_build/links")

"""nvscope: analyzer and diagnostics for CODESYS network variables."""

# An interrupt before the program can end silently (nvscope.cli.start) shows a traceback: nothing is imported here.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from nvscope.notebook import open_captures as open
    from nvscope.version import __version__
__all__ = ["__version__", "open"]


def __getattr__(name: str) -> object:
    # The program starts without what notebooks need.
    if name == "open":
        from nvscope.notebook import open_captures  # noqa: PLC0415

        return open_captures
    if name == "__version__":
        from nvscope.version import __version__  # noqa: PLC0415

        return __version__
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

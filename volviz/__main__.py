"""`volviz` and `python -m volviz`."""


def main() -> None:
    """Run the command line; Ctrl-C while it is still being loaded is a line like any other."""
    try:
        from volviz.cli import main as command_line

        command_line()
    except KeyboardInterrupt:
        import os

        os.write(2, b"volviz: error: cancelled\n")
        os._exit(130)


if __name__ == "__main__":
    main()

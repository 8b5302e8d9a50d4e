"""The command line: `volviz COMMAND …`. Commands are imported when called: help stays quick."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import signal
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from volviz._version import __version__
from volviz.errors import OutputError, VolvizError, did_you_mean, safe_text

# name: (module, what it does)
COMMANDS: dict[str, tuple[str, str]] = {
    "render": ("volviz.cli.render", "Draw a file, a folder, a sample or a scene to a picture."),
    "view": ("volviz.cli.view", "Show it in a window, with panels to change everything."),
    "surface": ("volviz.cli.surface", "Extract an isosurface: measure it, write it as a mesh."),
    "compare": (
        "volviz.cli.compare",
        "Vary any knob: pictures side by side, their time and their error.",
    ),
    "info": ("volviz.cli.info", "Say what a file is, before loading it."),
    "presets": ("volviz.cli.lists", "List the transfer functions with a name."),
    "samples": ("volviz.cli.lists", "List the volumes made by code."),
    "doctor": (
        "volviz.cli.doctor",
        "Say which OpenGL there is, what it can do, and what is missing.",
    ),
}


STDOUT = "standard output"
NARROWEST = 64

CANCELLED = 130


class _Commands(TyperGroup):
    """Commands by name, imported on first use; in a list they are names and one line of help."""

    listing = False

    def list_commands(self, ctx: Any) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in COMMANDS:
            return None
        module, help_text = COMMANDS[cmd_name]
        if self.listing:
            return TyperCommand(cmd_name, help=help_text)
        app = getattr(import_module(module), cmd_name)
        command = typer.main.get_command(app)
        command.name = cmd_name
        command.help = help_text + (f"\n\n{command.help}" if command.help else "")
        return command

    def format_help(self, ctx: Any, formatter: Any) -> None:
        self.listing = True
        super().format_help(ctx, formatter)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args and not args[0].startswith("-") and args[0] not in COMMANDS:
            args = self._without_command(args)
        return super().resolve_command(ctx, args)

    def _without_command(self, args: list[str]) -> list[str]:
        """`volviz FILE…` shows the file; a word that looks like a mistyped command is one."""
        from volviz.errors import UsageError
        from volviz.sources import is_sample

        word = args[0]
        if is_sample(word) or any(c in word for c in "./\\"):
            return ["view", *args]
        raise UsageError(f"unknown command or file '{word}'", fix=did_you_mean(word, COMMANDS))


def _version(show: bool) -> None:
    if show:
        print(f"volviz {__version__}")
        raise typer.Exit


app = typer.Typer(
    cls=_Commands,
    invoke_without_command=True,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="See inside 3D data: CT, MRI, microscopy, ultrasound, seismic, CFD.",
)


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: bool = typer.Option(
        False, "--version", help="Print the version.", callback=_version, is_eager=True
    ),
    debug: bool = typer.Option(False, "--debug", help="Show tracebacks of errors."),
) -> None:
    if context.invoked_subcommand is not None:
        return
    from volviz.cli.view import has_display, show_window

    if has_display():
        show_window([], {})
    else:
        print(context.get_help())
        raise typer.Exit(2)


def main(args: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code."""
    _prepare_streams()
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        # as with Ctrl-C: what is half written goes
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    code = run(sys.argv[1:] if args is None else args)
    try:
        sys.stdout.flush()
    except OSError:  # told already; the interpreter would tell it again on leaving
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    if code == CANCELLED:  # at once: what was interrupted half-way is not to be torn down in order
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


def _prepare_streams() -> None:
    """Streams that were closed get a stand-in; letters that a terminal lacks become others."""
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115
    if sys.stdout is None:  # writing to it fails, and that is told
        sys.stdout = open(os.devnull)  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    if os.environ.get("COLUMNS") == "0":
        del os.environ["COLUMNS"]
    if shutil.get_terminal_size().columns < NARROWEST:  # help in fewer columns has no words
        os.environ["COLUMNS"] = str(NARROWEST)


def run(args: Sequence[str]) -> int:
    """Run the command line; the exit code. Errors are one line on standard error."""
    debug, args = _without_debug(args)
    try:
        command = typer.main.get_command(app)
        code = command.main(args, prog_name="volviz", standalone_mode=False)
        sys.stdout.flush()
    except VolvizError as error:
        return _failed(str(error), error.exit_code, debug)
    except KeyboardInterrupt:
        return _failed("cancelled", CANCELLED, False)
    except BrokenPipeError:
        return 0  # who read us has gone; nothing more to say
    except SystemExit as left:  # the parser's answer to the same
        return 0 if isinstance(left.__context__, BrokenPipeError) else int(left.code or 0)
    except MemoryError:
        return _failed("out of memory — close other programs, or read less of the file", 6, debug)
    except Exception as error:
        unwritten = _unwritten(error)
        if unwritten is not None:
            return _failed(str(unwritten), unwritten.exit_code, debug)
        return _unforeseen(error, args, debug)
    if code == CANCELLED:  # the parser answers Ctrl-C with a code
        return _failed("cancelled", CANCELLED, False)
    return code if isinstance(code, int) else 0


def _without_debug(args: Sequence[str]) -> tuple[bool, list[str]]:
    """--debug may stand anywhere before a `--`."""
    end = list(args).index("--") if "--" in args else len(args)
    return "--debug" in args[:end], [a for a in args[:end] if a != "--debug"] + list(args[end:])


def _unwritten(error: Exception) -> OutputError | None:
    """The error of a standard output that takes nothing; None if that was not it."""
    if not isinstance(error, OSError) or error.filename is not None:
        return None
    if not sys.stdout.writable():
        return OutputError("is closed", file=STDOUT, fix="give a file with -o")
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):  # these come of writing alone
        return OutputError(f"cannot be written: {error.strerror}", file=STDOUT)
    return None


def _unforeseen(error: Exception, args: Sequence[str], debug: bool) -> int:
    if hasattr(error, "format_message"):  # the parser's own errors: usage
        if type(error).__name__ == "NoArgsIsHelpError":
            print(getattr(getattr(error, "ctx", None), "get_help", str)(), end="")
            return 2
        from volviz.cli import wrong_words

        return _failed(wrong_words.told(error, args, *_command_of(error, args)), 2, debug)
    kind = type(error).__name__
    return _failed(
        f"this is a bug in volviz: {kind}: {safe_text(error)} — report it with what --debug says",
        1,
        debug,
    )


def _command_of(error: Any, args: Sequence[str]) -> tuple[str, Sequence[Any]]:
    """How the command is typed that did not take its arguments, and its parameters."""
    context = getattr(error, "ctx", None)
    name = next((a for a in args if not a.startswith("-")), None)
    if context is not None and (context.parent is not None or name not in COMMANDS):
        return context.command_path, context.command.params
    if name is None:
        return "volviz", ()
    name = name if name in COMMANDS else "view"  # as a file without a command is shown
    app = getattr(import_module(COMMANDS[name][0]), name)
    return f"volviz {name}", typer.main.get_command(app).params


def _failed(text: str, code: int, debug: bool) -> int:
    if debug:
        import traceback

        traceback.print_exc()
    with contextlib.suppress(OSError):  # a full disk behind it takes no words either
        print(f"volviz: error: {text}", file=sys.stderr)
    return code

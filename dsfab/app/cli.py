"""The command line: runs commands, prints errors, and returns exit codes."""

import errno
import gc
import os
import platform
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from cyclopts import App, CycloptsError, RepeatArgumentError

from dsfab import __version__
from dsfab.app.terminal import ExitCode
from dsfab.core.errors import DsfabError, NotMadeError

LISTS = ("-f", "--format", "--against")  # Options that take several values, separated by commas.

app = App(
    name="dsfab",
    help="Diffusion Structures: from a surface, its supports and its loads to a file that a fabricator opens.",
    help_epilogue="Start with `dsfab build dome`, or with a mesh of yours: `dsfab build my_roof.obj`.",
    version=__version__,
    suppress_keyboard_interrupt=False,
)
# commands are given as import paths, so that Python imports only the module of the requested command
app.command(
    "dsfab.app.build:build", name="build", help="Build a preset: solid, sheet, picture and numbers, in one folder."
)
app.command(
    "dsfab.app.new:new", name="new", help="Write a preset for a surface of your own, with a line for each decision."
)
app.command("dsfab.app.size:size", name="size", help="Choose the thinnest sheet from the stock that meets the targets.")
app.command("dsfab.app.export:export", name="export", help="Write one file: solid, lines, drawing, fields or model.")
app.command(
    "dsfab.app.workshop:workshop", name="workshop", help="Cut a design from sheets: flat parts, nested on the stock."
)
app.command("dsfab.app.report:report", name="report", help="Report the utilisation of members by Eurocode 3 or 5.")
app.command("dsfab.app.preview:preview", name="preview", help="Draw a design without building it.")
app.command("dsfab.app.check:check", name="check", help="Check an exported solid, and compare it with the design.")
app.command("dsfab.app.explore:explore", name="explore", help="Draw many variants of a design on one contact sheet.")
app.command("dsfab.app.editor:edit", name="edit", help="Change a design in your browser and watch it.")
app.command("dsfab.app.hops:hops", name="hops", help="Serve components to Grasshopper on this machine.")
app.command("dsfab.app.blender:blender", name="blender", help="Write an add-on for Blender.")
app.command("dsfab.app.sweep:sweep", name="sweep", help="Make many designs of a preset; stop and go on at any time.")
app.command("dsfab.app.compare:compare", name="compare", help="Compare a design with others of the same mass.")
app.command("dsfab.app.listing:presets", name="presets", help="List the presets that come with dsfab.")
app.command(
    "dsfab.app.listing:materials", name="materials", help="List the materials that a preset may name, with sources."
)
app.command("dsfab.app.listing:inspect", name="inspect", help="Describe a mesh file, and check the mesh for faults.")
app.command(
    "dsfab.app.verify:verify", name="verify", help="Solve structures with published answers to test the statics."
)
app.command(
    "dsfab.app.reproduce:reproduce",
    name="reproduce",
    help="Make the figures of the paper by Madan et al., on one page.",
)
app.command("dsfab.app.bench:bench", name="bench", help="Time each stage of presets (Table 2 of Madan et al.).")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command in `arguments` (default: sys.argv), print any error, and return the exit code."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    if arguments is None:  # fewer garbage collections make imports 10 % faster
        gc.set_threshold(100_000, *gc.get_threshold()[1:])
    try:
        with warnings.catch_warnings():
            if arguments is None and not sys.warnoptions:  # python's option -W decides about warnings, if given
                warnings.simplefilter("ignore")
            code = app(words, exit_on_error=False, print_error=False, result_action="return_value")
    except RepeatArgumentError as error:
        return _fail(ExitCode.WRONG_USAGE, _given_twice(words, error.token.keyword or ""))
    except CycloptsError as error:
        command = " ".join(("dsfab", *(error.command_chain or ())))
        return _fail(ExitCode.WRONG_USAGE, f"{str(error).strip()} Try `{command} --help`.")
    except NotMadeError as error:
        return _fail(ExitCode.NOT_MADE, str(error))
    except DsfabError as error:
        return _fail(ExitCode.REFUSED, str(error))
    except KeyboardInterrupt:
        return _fail(ExitCode.INTERRUPTED, "dsfab was stopped; no file is half written")
    except BrokenPipeError:  # a reader such as `dsfab presets | head` closes the pipe
        sys.stderr.close()
        return ExitCode.DONE
    except MemoryError as error:
        return _fail(ExitCode.BUG, f"the memory is too small; make the mesh coarser{_details(words, error)}")
    except Exception as error:  # any other error is a bug
        if isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG:
            return _fail(ExitCode.REFUSED, f"the name {str(error.filename)[:40]}... is too long; choose a shorter name")
        return _fail(ExitCode.BUG, f"dsfab made a mistake, and nothing was written{_details(words, error)}")
    return int(code) if isinstance(code, int) else ExitCode.DONE


def _given_twice(words: Sequence[str], option: str) -> str:
    values = [value for word, value in pairwise(words) if word == option]
    listed = f", with commas: {option} {','.join(values)}" if option in LISTS and len(values) > 1 else ""
    return f"option {option} appears more than once; give it once{listed}"


def _details(words: Sequence[str], error: BaseException) -> str:
    text = "\n".join(
        [
            f"dsfab {__version__}, Python {platform.python_version()}, {platform.system()} {platform.machine()}",
            time.strftime("%Y-%m-%d %H:%M:%S"),
            f"arguments: {list(words)}",
            "",
            *traceback.format_exception(error),
        ]
    )
    try:
        number, name = tempfile.mkstemp(prefix="dsfab-", suffix=".log")
        with os.fdopen(number, "w", encoding="utf-8", errors="replace") as file:
            file.write(text)
    except OSError:
        return f" ({type(error).__name__}; the file with the details could not be written)"
    return f"; please report the mistake, with the details in {Path(name)}"


def _fail(code: int, text: str) -> int:
    print(f"dsfab: {text}", file=sys.stderr)  # noqa: T201
    return code


if __name__ == "__main__":
    sys.exit(main())

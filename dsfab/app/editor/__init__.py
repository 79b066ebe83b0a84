"""The command `dsfab edit`: change a design in the browser."""

import sys
import webbrowser
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from dsfab.app.options import UNCHANGED, Source
from dsfab.app.terminal import print_result, signals_as_interrupts
from dsfab.core.errors import DsfabError

OUTPUTS = "outputs"  # Folder of builds, inside the current folder. `dsfab build` also writes into this folder.


def edit(
    target: str = "dome",
    /,
    *,
    source: Source = UNCHANGED,
    port: Annotated[int, Parameter(help="Port on this machine; 0 takes a free port.")] = 0,
    open_: Annotated[bool, Parameter(name="--open", help="Open the editor in the browser.")] = True,
) -> int:
    """Change a design with sliders in your own browser; no data leave this machine.

    Parameters
    ----------
    target
        Name of a shipped preset (see `dsfab presets`), a TOML file, or a mesh file."""
    from dsfab.app.editor.server import EditorServer
    from dsfab.app.editor.session import Session
    from dsfab.app.editor.workspace import Outputs, open_preset

    opened = open_preset(target, source)
    outputs = Outputs(Path(OUTPUTS).absolute(), OUTPUTS)
    with signals_as_interrupts(), Session(opened, outputs=outputs) as session:
        session.ask_solve({})  # solve while the server and the browser start
        try:
            server = EditorServer(session, port)
        except OSError as error:
            raise DsfabError(
                f"port {port} cannot be used ({error.strerror}); leave --port out for a free port"
            ) from None
        with server:
            try:
                print_result(f"dsfab edit {opened.preset.name}: {server.address}")
                print_result("Ctrl-C ends it.")
                sys.stdout.flush()  # a program that reads this pipe waits for the address
                if open_:
                    webbrowser.open(server.address)
                server.serve_forever(poll_interval=0.2)
            except KeyboardInterrupt:
                print_result()
    return 0

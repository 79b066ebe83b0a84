"""The command `dsfab hops`: a server of components for Grasshopper."""

import sys
from typing import Annotated

from cyclopts import Parameter

from dsfab.app.terminal import print_result
from dsfab.core.errors import DsfabError


def hops(
    *,
    port: Annotated[int, Parameter(help="Port on this machine; 0 takes a free port.")] = 5000,
    seconds: Annotated[float, Parameter(help="Time limit of a component.")] = 300.0,
) -> int:
    """Serve components to Grasshopper on this machine; a Hops component takes one of the printed addresses."""
    from dsfab.app.hops.components import COMPONENTS
    from dsfab.app.hops.server import HopsServer, Solver
    from dsfab.export import require_rhino

    require_rhino("geometry of Grasshopper needs")
    if not seconds > 0:
        raise DsfabError(f"--seconds {seconds:g} is not positive; give a number over 0")
    with Solver(seconds) as solver:
        try:
            server = HopsServer(solver, port)
        except (OSError, OverflowError):
            raise DsfabError(
                f"port {port} cannot be used; choose another port, or let dsfab choose a free port with --port 0"
            ) from None
        with server:
            try:
                for component in COMPONENTS.values():
                    print_result(f"{server.address}/{component.name}  {component.about}")
                print_result(
                    "Paste one of these addresses into a Hops component of Grasshopper. Ctrl-C ends the server."
                )
                sys.stdout.flush()  # a program that reads this pipe waits for the address
                server.serve_forever(poll_interval=0.2)
            except KeyboardInterrupt:
                print_result()
    return 0

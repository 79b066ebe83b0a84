"""Test whether this machine can draw off screen."""

import os
import subprocess
import sys
import threading
from functools import cache

from dsfab.core.errors import DsfabError

WINDOW = "VTK_DEFAULT_OPENGL_WINDOW"  # environment variable by which VTK chooses its kind of window
SECONDS = 120  # time limit of the test

# the test must draw a frame, because VTK loads its graphics libraries at the first frame
PROBE = """
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
from vtkmodules.vtkCommonCore import vtkUnsignedCharArray
import vtkmodules.vtkRenderingOpenGL2
window, renderer, pixels = vtkRenderWindow(), vtkRenderer(), vtkUnsignedCharArray()
renderer.SetBackground(1.0, 0.0, 0.0)
window.SetOffScreenRendering(1)
window.SetSize(8, 8)
window.AddRenderer(renderer)
window.Render()
window.GetPixelData(0, 0, 7, 7, 1, pixels, 0)
raise SystemExit(0 if pixels.GetTuple3(0) == (255.0, 0.0, 0.0) else 3)
"""

_KNOWN: set[str] = set()  # kinds of VTK render window that need no test
_PROBES: list[threading.Thread] = []  # the running test, if any


def probe_ahead() -> None:
    """Begin to test in the background whether this machine can draw."""
    name = window_kinds(_window_choice())[0]
    if not _PROBES and name not in _KNOWN:
        _PROBES.append(threading.Thread(target=lambda: _draws(name), daemon=True))
        _PROBES[-1].start()


def assume_window(window: str | None = None) -> str:
    """Set the kind of VTK window without a test, and return its name. window : the kind; None for the usual kind."""
    name = window_kinds(os.environ.get(WINDOW, ""))[0] if window is None else window
    _KNOWN.add(name)
    if name:
        os.environ[WINDOW] = name
    else:
        os.environ.pop(WINDOW, None)
    return name


def forget_windows() -> None:
    """Discard the results of all tests of window kinds."""
    _KNOWN.clear()
    _draws.cache_clear()


def require_rendering() -> None:
    """Raise DsfabError with the packages to install if this machine cannot draw."""
    chosen = _window_choice()
    while _PROBES:
        _PROBES.pop().join()
    working = next((name for name in window_kinds(chosen) if name in _KNOWN or _draws(name)), None)
    if working is None:
        raise DsfabError(_advice_text(chosen))
    if working:
        os.environ.setdefault(WINDOW, working)


def _window_choice() -> str:
    chosen = os.environ.get(WINDOW, "")
    if not chosen:
        os.environ.pop(WINDOW, None)  # VTK crashes if the variable is empty
    return chosen


def why_no_pictures() -> str:
    """Return the reason why this machine cannot draw, or ""."""
    try:
        require_rendering()
    except DsfabError as error:
        return str(error)
    return ""


def window_kinds(chosen: str) -> tuple[str, ...]:
    """Return the kinds of VTK window to try, the best first. "" stands for VTK's own choice.
    chosen : kind that the user has set, or ""."""
    if chosen:
        return (chosen,)
    if not sys.platform.startswith("linux"):
        return ("",)
    without_screen = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
    return ("", *without_screen) if os.environ.get("DISPLAY") else without_screen


@cache
def _draws(name: str) -> bool:
    environment = {**os.environ, WINDOW: name} if name else dict(os.environ)
    command = [sys.executable, "-P", "-c", PROBE]
    try:
        answer = subprocess.run(command, env=environment, capture_output=True, timeout=SECONDS, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return answer.returncode == 0


_ADVICE = {
    "linux": "on Debian or Ubuntu install libegl1 and libgl1-mesa-dri, or libosmesa6; on Fedora install mesa-libEGL "
    "and mesa-dri-drivers",
    "darwin": "on macOS run dsfab in a session with a screen; macOS already contains OpenGL",
    "win32": "on Windows install the graphics card's driver or the OpenCL, OpenGL and Vulkan Compatibility Pack",
}


def _advice_text(chosen: str) -> str:
    system = "linux" if sys.platform.startswith("linux") else sys.platform
    other_advice = [text for name, text in _ADVICE.items() if name != system]
    advice = "; ".join([_ADVICE.get(system, ""), *other_advice]).strip("; ")
    window_text = f" with {WINDOW}={chosen}" if chosen else ""
    unset = f", unset {WINDOW}" if chosen else ""
    return (
        f"pictures cannot be drawn on this machine{window_text}: {advice}{unset}; `build --no-preview` needs no picture"
    )

# SPDX-License-Identifier: GPL-3.0-or-later
"""Starting the GPU without a screen, and what to tell a person when there is none to start."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import warnings

from _console import NOISE, Console
from _frame_files import RenderProblem

PROBE_SECONDS = 60
NO_GPU = (
    "no OpenGL context: {detail}. Without a GPU or a screen Blender draws with EGL and Mesa's software "
    "OpenGL: on Debian or Ubuntu, apt-get install libegl1 libgl1 libgl1-mesa-dri (or run make setup)"
)


def require_gpu(console: Console) -> None:
    """Start the GPU. Raises RenderProblem where there is none.

    Blender ends the whole process when it gets no context, so that a child process tries it first (a
    tenth of a second). Nothing is tried outside Linux, where a window system always has one.
    """
    if sys.platform == "linux":
        _try_in_child()
    import gpu

    try:
        with console.quiet():
            gpu.init()
    except SystemError as error:
        raise RenderProblem(NO_GPU.format(detail=error)) from None


def _try_in_child() -> None:
    with tempfile.TemporaryFile() as said, warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # fork beside threads
        child = os.fork()
        if child == 0:
            for number in (1, 2):
                os.dup2(said.fileno(), number)
            for signum in (signal.SIGSEGV, signal.SIGABRT, signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
                signal.signal(signum, signal.SIG_DFL)
            signal.alarm(PROBE_SECONDS)
            status = 1
            try:
                import gpu

                gpu.init()
                status = 0
            finally:
                os._exit(status)
        _, status = os.waitpid(child, 0)
        said.seek(0)
        text = said.read().decode("utf-8", "replace")
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGALRM:
        return  # hung, which a fork may do where the GPU itself works: the process itself tries next
    if status != 0:
        lines = [line.strip() for line in text.splitlines() if line.strip() and not NOISE.search(line)]
        told = [line for line in lines if "GL" in line] or lines
        raise RenderProblem(
            NO_GPU.format(detail=told[-1].rstrip(".") if told else "the system's driver gave none")
        )


def max_picture_size() -> int:
    """The GPU's limit for the width and height of a texture."""
    import gpu

    return gpu.capabilities.max_texture_size_get()


def machine() -> dict[str, str]:
    """What draws, for the statistics."""
    import gpu

    return {
        "renderer": gpu.platform.renderer_get(),
        "vendor": gpu.platform.vendor_get(),
        "driver": gpu.platform.version_get(),
        "backend": gpu.platform.backend_type_get(),
    }

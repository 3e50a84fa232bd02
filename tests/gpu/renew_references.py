# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the pictures of `tests/references/` anew: `python tests/gpu/renew_references.py`. Look at them."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))


def main() -> None:
    import bpy  # noqa: F401  (the gpu module is part of it)
    import gpu

    gpu.init()
    from lake_water_addon.render.frame import FrameRenderer
    from tests.gpu.pictures import save
    from tests.gpu.references import FOLDER, VIEWS, picture

    renderer = FrameRenderer()
    FOLDER.mkdir(exist_ok=True)
    for name in VIEWS:
        save(picture(renderer, name), FOLDER / f"{name}.png")
        print(FOLDER / f"{name}.png")


if __name__ == "__main__":
    main()

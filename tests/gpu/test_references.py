# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole pictures against those in `tests/references/`.

Allowed: 1/255 on average, more than 16/255 in 0.5 % of the pixels (knife-edge decisions at the water line,
which another version of Mesa may take differently), and a structural similarity of at least 0.99. After a
change that is meant: look at the pictures, then `python tests/gpu/renew_references.py`.
"""

import numpy as np
import pytest

from tests.gpu.pictures import amplified_difference, load, save
from tests.gpu.references import FOLDER, VIEWS, picture


@pytest.mark.parametrize("name", VIEWS)
def test_picture_is_that_of_the_reference(renderer, tmp_path, name):
    from skimage.metrics import structural_similarity

    drawn, reference = picture(renderer, name), load(FOLDER / f"{name}.png")
    assert drawn.shape == reference.shape
    difference = np.abs(drawn.astype(int) - reference.astype(int)).max(axis=-1)
    mean, outliers = difference.mean(), np.mean(difference > 16)
    similarity = structural_similarity(drawn, reference, channel_axis=-1)
    if mean <= 1.0 and outliers <= 0.005 and similarity >= 0.99:
        return
    save(drawn, tmp_path / f"{name}_drawn.png")
    save(amplified_difference(drawn, reference), tmp_path / f"{name}_difference_x8.png")
    pytest.fail(
        f"{name}: mean difference {mean:.2f}/255, {outliers:.2%} of the pixels by more than 16/255, largest "
        f"{difference.max()}/255, similarity {similarity:.4f}. Picture and differences are in {tmp_path}"
    )

# SPDX-License-Identifier: GPL-3.0-or-later
"""Property tests try the same examples in every run: a failure is one of the code and not of the day."""

from hypothesis import settings

settings.register_profile("lake_water", derandomize=True, deadline=None, max_examples=60, database=None)
settings.load_profile("lake_water")

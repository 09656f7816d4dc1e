"""Suites by what their obstacles are."""

from ferguson_gym.world.suites import SUITES, suite_field

OF_DISCS = [suite for suite in SUITES if suite_field(suite, "train", 0).obstacles.are_discs]

"""Files that left the observation out keep the one that was the default when they were written."""

from ferguson_gym.simulation import Settings, arguments_to_save, saved_arguments


def test_the_default_observation_is_rays() -> None:
    assert Settings().observation == "rays"
    assert Settings().layout.entries() == {"goal": 3, "rays": 64, "vehicle": 6}


def test_files_name_their_observation() -> None:
    assert arguments_to_save({"suite": "sparse"}) == {"observation": "rays", "suite": "sparse"}
    assert arguments_to_save({"observation": "both"}) == {"observation": "both"}


def test_files_that_do_not_name_it_observe_discs() -> None:
    assert saved_arguments({"nearest": 4}) == {"observation": "discs", "nearest": 4}
    assert saved_arguments({"observation": "rays"}) == {"observation": "rays"}
    assert Settings(**saved_arguments({})).layout.entries() == {
        "goal": 3,
        "mask": 12,
        "obstacles": 48,
        "vehicle": 6,
    }

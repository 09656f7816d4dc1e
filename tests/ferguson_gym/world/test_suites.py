"""Recipes of fields: the paper's four, and suites that never change."""

import hashlib
import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.paper_fields import is_from_paper, paper_field
from ferguson_gym.world.recipes.scattered import latin_hypercube
from ferguson_gym.world.suites import (
    LAST_SEED,
    SPLITS,
    SUITES,
    Scattered,
    suite_field,
    suite_obstacles,
    with_overrides,
)
from tests.support.places import DATA

# coordinates to ten decimals and shortest paths to six, reconstructed independently
PAPER = json.loads((DATA / "paper_fields.json").read_text())

# SHA-256 of the bytes of corners (centres of discs) and radii, and of where the cores of other
# obstacles begin; a change of any is a new suite
HASHES = {
    "standard/train:0": "fa369a8a9c996c75f8dfc5754cc6de4efab8dfc8f278ea3008848eb81f6d87ef",
    "standard/train:99": "166161e78cefa54f9ce72da8084765b9f07ccc5a5d78c6a21232ad3306480577",
    "standard/validation:0": "26f5dff44fa073ef6b90eb0db1bebb4e7fd45899d3432f6e05fb563b0db404ef",
    "standard/test:0": "9a65a05aa0a83a1e1ffe11d16f4d18e6cdcbf79463cf067843ebbc5bd63b9ce0",
    "standard/test:5000000000": "9f17f7ea624c49ade36022150d59601fb3cf0123fe7e4b1c0ad70c7ce78f70a5",
    "sparse/train:0": "24dcd477b41ce049da0b01b24ef35af1ed6e1f2f9ec46180e8cd4a2909a946fc",
    "sparse/train:99": "a825489f5e2ba27f60f59a91e53679eefa01b05b9003b28edc80e1b43999bd01",
    "sparse/validation:0": "298467c72a69018ac76d1289ad6fbe426a4c96f3ab77019445c02c83e7be0555",
    "sparse/test:0": "eaf3f7e30943c27d9e5006709a19c642f0de3130e91ef2a7c4eb7f3a1edfa77f",
    "dense/train:0": "199884b140151a356900f6ed60e01161ad5066361b8b5ad406b0993a3c5709ca",
    "dense/train:99": "285bf11df105faa741405307e71fa0f8a3a0d5c962228d5b037ea7cf533cb82b",
    "dense/validation:0": "a3c5cd0c72ae7702d89d8beb5202d3acfdd4523fb8653e03eb5cdaa8640bd42e",
    "dense/test:0": "6ef4d2d1ef08461527d15b34e518768fbc6c44b051b4b87262481eee33f1b053",
    "forest/train:0": "aedf77f17187a12ea4926ce4afbf0448c0870ef73c5fb08afcd929ea30fdeb1c",
    "forest/train:99": "4b15eadc37a9c7418228fc6e4185758f54b13bfc559bbfb80a001b13a35838c5",
    "forest/validation:0": "0c27a9eed55a13b5ba6fecfab97b320f76354c3e0bf78c94cf3691a78fd94218",
    "forest/test:0": "a9d9fe54332de5e475282a6b81fc713065c4b1a546767b36771165fced0572ec",
    "traps/train:0": "1875e20e5c9db2fb5a17a6e7aa6466c459a84d5e67dc2ca4354bbdcbcd8a3ebe",
    "traps/train:99": "6a9e82488f321673604393853c9740753966536c36fae401f5c4445294204b74",
    "traps/validation:0": "72f52a9fb75666ea2184133866ddde1eb42978377efe170d17a881a1a4585708",
    "traps/test:0": "ef627ef0b704125017a8fdb786be03d7d7a2a1313cb2aa5591cddb47fb6ba069",
    "town/train:0": "2bda4e671dc2967a6f29197ee617f0a5ab077dd9086bb7b5c51ef6d85f67b31c",
    "town/train:99": "f0f1ba4a2858df29838dc1454930ff84fb93aad4f5df76d9beaee4fb88464d6a",
    "town/validation:0": "802222dfec3696fd9b1fb76b6668d40991609d491f9815053443ee92f17aafd1",
    "town/test:0": "4a8294ddc5b6e622528ba054cbf3d28b48171c0a580c5b6e190652d8194f5ad1",
    "town/test:5000000000": "76c66d047b554f24ee86c411e2c21c1bfba4cbcbb0097e33b8911ede6395bc34",
    "walls/train:0": "158f3ddcc13c9c1384943a5855fdab8385b7e05a69703d6c4fb2cb049ebcae56",
    "walls/train:99": "d9a2222c89f0acd1c427fa6a423843ed019cbf4b83b40a2a015d0d81ab3ff213",
    "walls/validation:0": "9f84480fe8662e8e7a74f923eaa1cb7918d1a852e195a725d3fef9edd9e0e390",
    "walls/test:0": "66f520a91fef9702ea97ceb7515eb3dbe649d12a6771fe8a780df55fc10759d7",
    "walls/test:5000000000": "47322d5c45e56e3cef82772fe846b15dc758cee69b84863b819fb1032d8fdaef",
}


def draw(name):
    suite, _, rest = name.partition("/")
    split, _, seed = rest.partition(":")
    return suite_field(suite, split, int(seed))


def fingerprint(field):
    obstacles = field.obstacles
    starts = b"" if obstacles.are_discs else obstacles.starts.tobytes()
    every = obstacles.points.tobytes() + obstacles.radii.tobytes() + starts
    return hashlib.sha256(every).hexdigest()


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_paper_fields_are_the_reconstruction(number):
    field, reference = paper_field(number), PAPER[f"rng{number}"]
    assert field.name == f"paper:{number}"
    np.testing.assert_allclose(field.obstacles.centers, reference["centers"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(field.obstacles.radii, reference["radii"], rtol=0, atol=1e-9)
    assert is_from_paper(field)
    assert field.start.tolist() == [0.0, 0.0]
    assert field.goal.tolist() == [100.0, 100.0]
    assert field.bounds.tolist() == [[-10.0, -10.0], [110.0, 110.0]]


@pytest.mark.parametrize("number", [0, 5, -1])
def test_the_paper_has_no_other_fields(number):
    with pytest.raises(ValueError, match=f"1 to 4, not {number}"):
        paper_field(number)


def test_a_field_is_the_papers_by_its_content_not_by_its_name_alone():
    own, other = paper_field(1).obstacles, paper_field(2).obstacles
    assert is_from_paper(Field(name="paper:1", obstacles=own))
    for field in (
        Field(name="paper:1", obstacles=other),
        Field(name="paper:1", obstacles=Obstacles.discs(own.centers, other.radii)),
        Field(name="paper:1", obstacles=own, goal=np.array([20.0, 0.0])),
        Field(name="paper:2", obstacles=own),
        paper_field(1).with_limits(longest=30),
        Field(name="paper:5", obstacles=own),
        Field(name="paper", obstacles=own),
        suite_field("standard", "train", 0),
    ):
        assert not is_from_paper(field), field.name


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("points", [5, 25])
def test_latin_hypercubes_hold_one_point_in_every_row_and_column(points, seed):
    design = latin_hypercube(np.random.RandomState(seed), points)
    cells = np.sort(np.floor(design * points), axis=0)
    np.testing.assert_array_equal(cells, np.stack([np.arange(points)] * 2, axis=-1))


@pytest.mark.parametrize("name", HASHES)
def test_fields_of_a_suite_never_change(name):
    assert fingerprint(draw(name)) == HASHES[name]


def test_a_field_does_not_depend_on_what_was_drawn_before():
    np.random.seed(1)  # noqa: NPY002 (the global stream is what must not matter)
    draw("dense/test:7")
    assert fingerprint(draw("standard/train:0")) == HASHES["standard/train:0"]


def test_suites_splits_and_seeds_share_no_field():
    # beyond 2^32 a seed must not wrap around
    seeds = (0, 1, 2, 2**32 - 1, 2**32, 2**32 + 1, LAST_SEED)
    names = [f"{suite}/{split}:{seed}" for suite in SUITES for split in SPLITS for seed in seeds]
    fields = [draw(name) for name in names]
    assert [field.name for field in fields] == names
    assert len({fingerprint(field) for field in fields}) == len(names)
    # nor a single corner, which a shared stream would repeat
    last = [set(map(tuple, field.obstacles.points[-5:].tolist())) for field in fields]
    for one, other in itertools.combinations(last, 2):
        assert not one & other


@pytest.mark.parametrize(
    ("suite", "least", "most", "smallest", "largest", "room"),
    [
        # the corner of [5, 95]^2 is 7.07 m from start and goal
        ("standard", 50, 50, 3.0, 7.0, 50**0.5 - 7.0),
        ("sparse", 20, 20, 3.0, 7.0, 50**0.5 - 7.0),
        ("dense", 70, 70, 3.0, 7.0, 50**0.5 - 7.0),
        ("forest", 180, 180, 0.5, 1.5, 50**0.5 - 1.5),
        ("traps", 40, 120, 2.0, 5.0, 6.0),
    ],
)
def test_every_field_of_a_suite_follows_its_recipe(suite, least, most, smallest, largest, room):
    for seed in range(100):
        field = suite_field(suite, SPLITS[seed % 3], seed)
        discs = field.obstacles
        assert least <= len(discs) <= most
        assert discs.centers.shape == (len(discs), 2)
        assert smallest <= discs.radii.min()
        assert discs.radii.max() <= largest
        assert discs.centers.min() >= 5.0
        assert discs.centers.max() <= 95.0
        ends = np.array([field.start, field.goal])
        assert discs.signed_distance(ends).min() >= room
        assert field.start.tolist() == [0.0, 0.0]
        assert field.goal.tolist() == [100.0, 100.0]


@pytest.mark.parametrize("seed", range(5))
def test_pockets_are_chains_of_overlapping_discs(seed):
    discs = suite_field("traps", "train", seed).obstacles
    neighbours = discs.centers[1:] - discs.centers[:-1]
    overlap = discs.radii[1:] + discs.radii[:-1] - np.linalg.norm(neighbours, axis=-1)
    # five chains and twelve single discs end; discs left out break some chains
    assert (overlap > 0.0).sum() >= len(discs) - 5 - 12 - 5


@pytest.mark.parametrize("suite", SUITES)
@pytest.mark.parametrize("seed", [-1, LAST_SEED + 1])
def test_seeds_out_of_range_are_refused(suite, seed):
    with pytest.raises(ValueError, match=f"got {seed}"):
        suite_field(suite, "train", seed)


@pytest.mark.parametrize(
    ("suite", "split", "message"),
    [
        ("jungle", "train", "unknown suite 'jungle'; suites are standard, sparse, dense"),
        ("standard", "exam", "unknown split 'exam'; splits are train, validation, test"),
        (None, "train", "unknown suite None; suites are"),
        ("standard", None, "unknown split None; splits are"),
        ("", "train", "unknown suite ''"),
        ("standard", "", "unknown split ''"),
    ],
)
def test_unknown_suites_and_splits_are_named(suite, split, message):
    with pytest.raises(ValueError, match=message):
        suite_field(suite, split, 0)


@pytest.mark.parametrize("suite", SUITES)
def test_obstacles_of_a_suite_are_those_of_its_field(suite: str) -> None:
    for split, seed in itertools.product(SPLITS, (0, 5, 2**40)):
        obstacles, field = suite_obstacles(suite, split, seed), suite_field(suite, split, seed)
        for name in ("points", "radii", "first"):
            np.testing.assert_array_equal(getattr(obstacles, name), getattr(field.obstacles, name))


def test_another_recipe_draws_from_the_suites_own_stream() -> None:
    numbers = []

    def recipe(stream: np.random.RandomState) -> Obstacles:
        numbers.append(stream.random_sample())
        return Obstacles.discs([[numbers[-1], 0.0]], [1.0])

    for suite, split, seed in (("standard", "train", 3), ("dense", "train", 3)) * 2:
        discs = suite_obstacles(suite, split, seed, recipe)
        assert discs.centers[0, 0] == numbers[-1]
    assert numbers[:2] == numbers[2:]
    assert numbers[0] != numbers[1]


@pytest.mark.parametrize(
    ("designs", "smallest", "largest"), [((25, 25), 3.0, 7.0), ((4,), 1.0, 1.0), ((), 2.0, 3.0)]
)
def test_scattered_discs_lie_on_latin_hypercubes(designs, smallest, largest):
    discs = Scattered(designs, smallest, largest)(np.random.RandomState(7))
    assert len(discs) == sum(designs)
    assert (discs.radii >= smallest).all()
    assert (discs.radii <= largest).all()
    first = 0
    for points in designs:
        cells = np.floor((discs.centers[first : first + points] - 5.0) / 90.0 * points)
        np.testing.assert_array_equal(
            np.sort(cells, axis=0), np.stack([np.arange(points)] * 2, axis=-1)
        )
        first += points


@pytest.mark.parametrize(
    ("smallest", "largest"), [(0.0, 1.0), (-1.0, 1.0), (2.0, 1.0), (3.0, 7.001), (np.nan, 1.0)]
)
def test_invalid_radii_of_a_recipe_are_refused(smallest, largest):
    with pytest.raises(ValueError, match=f"0 < smallest <= largest <= 7 m .* got {smallest} and"):
        Scattered((5,), smallest, largest)


@pytest.mark.parametrize(
    ("suite", "obstacles", "designs"),
    [
        ("standard", 50, (25, 25)),
        ("standard", 51, (25, 26)),
        ("standard", 1, (1,)),
        ("standard", 0, ()),
        ("forest", 180, (60, 60, 60)),
        ("forest", 100, (33, 33, 34)),
        ("forest", 2, (1, 1)),
    ],
)
def test_altered_recipes_spread_obstacles_over_the_suites_designs(suite, obstacles, designs):
    recipe = with_overrides(suite, obstacles=obstacles)
    assert recipe.designs == designs
    assert (recipe.smallest, recipe.largest) == (SUITES[suite].smallest, SUITES[suite].largest)


def test_altered_recipes_keep_what_is_not_altered():
    for suite in ("standard", "sparse", "dense", "forest"):
        assert with_overrides(suite) == SUITES[suite]
        recipe = with_overrides(suite, radii=(1, 2))
        assert recipe == replace(SUITES[suite], smallest=1.0, largest=2.0)
        assert isinstance(recipe.smallest, float)
    own, thin = with_overrides("standard"), with_overrides("standard", radii=(1.0, 2.0))
    many = [suite_obstacles("standard", "train", 3, recipe) for recipe in (own, thin)]
    np.testing.assert_array_equal(many[0].centers, many[1].centers)
    np.testing.assert_allclose((many[0].radii - 3.0) / 4.0, many[1].radii - 1.0, atol=1e-12)


def test_recipes_that_cannot_be_altered_are_refused():
    changeable = "can be changed in standard, sparse, dense, forest$"
    for suite in ("traps", "town", "walls"):
        for arguments in ({}, {"obstacles": 3}, {"radii": (1.0, 2.0)}):
            with pytest.raises(ValueError, match=f"suite '{suite}' are fixed; .* {changeable}"):
                with_overrides(suite, **arguments)
    with pytest.raises(ValueError, match="0 obstacles or more, got -1"):
        with_overrides("standard", obstacles=-1)
    with pytest.raises(ValueError, match="radii"):
        with_overrides("standard", radii=(2.0, 8.0))

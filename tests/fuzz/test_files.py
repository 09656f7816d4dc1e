"""Damaged files of all kinds: what is read is sound, or one clear error names the file."""

import json
import math
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from agents.demonstrations import work as demonstrations_work
from agents.evaluation import reading, statistics
from agents.evaluation import work as evaluation_work
from agents.evaluation.report.page import write_report
from agents.evaluation.request import Request
from agents.evaluation.run import run
from agents.runtime.executors import Backend
from agents.training.hyperparameters import read as read_recipe
from ferguson_gym import ENVIRONMENT_ID
from tests.fuzz.cases import attempt, fuzzed
from tests.fuzz.damage import Damage
from tests.fuzz.strategies import damaged, twisted

FILES = ("flights.csv", "timings.csv", "paths.npz", "summary.json")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("files")


def request() -> Request:
    return Request(
        policies=["single-start"], fields=["sparse/train:0", "sparse/train:1"], seeds=[0], chunk=1
    )


@pytest.fixture(scope="module")
def results(place: Path) -> Path:
    """A directory of results."""
    directory = place / "results"
    run(request(), directory, Backend())
    return directory


@pytest.fixture(scope="module")
def work(place: Path) -> evaluation_work.Work:
    """An evaluation whose chunks are flown and whose results are not yet written."""
    unfinished = evaluation_work.Work(place / "unfinished", request())
    list(evaluation_work.fly(unfinished, unfinished.begin(), Backend()))
    return unfinished


def finite_or_none(value: Any) -> bool:
    """Whether no number anywhere is NaN."""
    if isinstance(value, dict):
        return all(map(finite_or_none, value.values()))
    if isinstance(value, list | tuple):
        return all(map(finite_or_none, value))
    return not (isinstance(value, float) and math.isnan(value))


@pytest.mark.parametrize("name", FILES)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_results_are_read_or_refused(results: Path, name: str) -> None:
    @fuzzed(f"files: {name} of an evaluation", few=2, many=1500, data=st.data())
    def case(data: Any) -> None:
        with Damage(results / name, data):
            table = attempt(reading.read, results)
            if table is not None:
                found = attempt(statistics.summary, table)
                assert finite_or_none(found)
                if data.draw(st.integers(0, 3)) == 0:
                    attempt(write_report, results)
            elif name != "flights.csv":
                assert name == "timings.csv"

    case()


@fuzzed("files: chunks of an evaluation", few=3, many=3000, data=st.data())
def test_chunks_are_read_or_refused(work: evaluation_work.Work, data: Any) -> None:
    with Damage(work.store.file(0), data):
        table = attempt(work.table, errors=(OSError,))
        if table is not None:
            assert len(table.outcomes) == work.request.flights
        attempt(work.drawn, "single-start", [0], errors=(OSError,))


@fuzzed(
    "files: request.json and summary.json before an evaluation", few=3, many=3000, data=st.data()
)
def test_work_is_taken_up_or_refused(work: evaluation_work.Work, results: Path, data: Any) -> None:
    done = evaluation_work.Work(results, work.request)
    for one, file in ((work, work.store.place / "request.json"), (done, results / "summary.json")):
        with Damage(file, data):
            attempt(evaluation_work.is_finished, one)


RECIPE = f"""{ENVIRONMENT_ID}:
  n_envs: 4
  n_timesteps: 1e4
  eval_freq: 32
  policy: mlp
  policy_kwargs: {{net_arch: [8, 8], activation_fn: tanh}}
  env_kwargs: {{suite: sparse, observation: rays}}
  learning_rate: lin_1e-3
  batch_size: 8
""".encode()
HOSTILE = [
    b"!!python/object/apply:os.system ['true']",
    b"!!python/name:os.system",
    b"&a [*a, *a]",
    b"a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]",
    b"[" * 3000,
    b"{" * 500,
    b"\xff\xfe\x00",
    b"? [1, 2]\n: 3",
    b"%YAML 9.9\n---\n1",
    b"1: 2\n1: 3",
    b"2020-99-99",
    b"!!int x",
    b"!!float ''",
    b"!!timestamp 1",
    b"? {}\n: 1",
    b"<<: 3",
    b"a: &a {b: 1}\n" + b"c: &c {<<: [*a, *a]}\n" * 30,
    f"{ENVIRONMENT_ID}: {{n_envs: .inf, n_timesteps: .nan, eval_freq: 1, policy: mlp}}".encode(),
    f"{ENVIRONMENT_ID}: {{n_envs: 2020-01-01, n_timesteps: 1, eval_freq: 1, policy: []}}".encode(),
    f"{ENVIRONMENT_ID}: {{1: 2}}".encode(),
    f'{ENVIRONMENT_ID}: {{"\\n": 2}}'.encode(),
    f"{ENVIRONMENT_ID}: {{n_envs: {'9' * 5000}}}".encode(),
]


@fuzzed(
    "files: hyperparameters",
    many=6000,
    text=damaged(RECIPE)
    | st.sampled_from(HOSTILE)
    | st.sampled_from(HOSTILE).flatmap(lambda one: damaged(RECIPE + one))
    | twisted(
        json.dumps({ENVIRONMENT_ID: {"n_envs": 4, "n_timesteps": 9, "policy": "mlp"}}).encode()
    )
    | st.text().map(lambda text: text.encode("utf-8", "replace")),
)
def test_hyperparameters_are_read_or_refused(place: Path, text: bytes) -> None:
    pytest.importorskip("yaml")
    file = place / "recipe.yml"
    file.write_bytes(text)
    recipe = attempt(read_recipe, str(file), {"learning_rate", "batch_size"})
    if recipe is not None:
        assert recipe.n_envs >= 1
        assert recipe.n_timesteps >= 1
        json.dumps(recipe.learner, allow_nan=False)
        json.dumps(recipe.env_kwargs, allow_nan=False)


@pytest.fixture(scope="module")
def flown(place: Path) -> tuple[Path, demonstrations_work.Request]:
    """Demonstrations that are flown and not yet a dataset."""
    asked = demonstrations_work.Request(
        expert="pursuit", specs=("sparse/train:0-1",), arguments={"observation": "rays", "rays": 4}
    )
    directory = place / "demos"
    store = demonstrations_work.open_store(directory, asked)
    list(demonstrations_work.fly(store, asked, store.begin(), 1))
    return directory, asked


@fuzzed("files: work on demonstrations", few=3, many=2500, data=st.data())
def test_work_on_demonstrations_is_taken_up_or_refused(
    flown: tuple[Path, demonstrations_work.Request], data: Any
) -> None:
    directory, asked = flown
    store = demonstrations_work.open_store(directory, asked)
    with Damage(directory / "request.json", data):
        attempt(store.holds_work)
    (chunk,) = directory.glob("chunk-*.npz")
    with Damage(chunk, data):
        found = attempt(lambda: list(demonstrations_work.flown(store)), errors=(OSError,))
        for episode in found or ():
            assert len(episode.actions) == len(episode.rewards)


@pytest.fixture(scope="module")
def dataset(
    place: Path, flown: tuple[Path, demonstrations_work.Request]
) -> Iterator[tuple[str, Path]]:
    """A dataset of demonstrations."""
    pytest.importorskip("minari")
    from agents.demonstrations.recording import make

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MINARI_DATASETS_PATH", str(place / "datasets"))
        name = "ferguson/fuzz-v0"
        where = place / "datasets" / name
        where.parent.mkdir(parents=True)
        make(flown[1], name, where, 1)
        yield name, where


@pytest.mark.parametrize("file", ["metadata.json", "main_data.hdf5"])
@pytest.mark.filterwarnings("ignore")
def test_a_dataset_is_read_or_refused(dataset: tuple[str, Path], file: str) -> None:
    from agents.demonstrations.reading import read

    name, where = dataset

    @fuzzed(f"files: {file} of demonstrations", few=2, many=600, data=st.data())
    def case(data: Any) -> None:
        with Damage(where / "data" / file, data):
            found = attempt(read, name)
            if found is not None:
                assert np.abs(found.actions).max() <= 1.0
                assert found.offsets[-1] == len(found.actions)

    case()


@pytest.fixture(scope="module")
def model(place: Path) -> Path:
    """A small model."""
    pytest.importorskip("sb3_contrib")
    from tests.support.small_models import saved

    return saved(place / "model")


@pytest.mark.filterwarnings("ignore::UserWarning")  # of what a library finds outdated
def test_a_model_is_loaded_or_refused(model: Path) -> None:
    from agents.models.loading import load

    @fuzzed("files: model.json", few=3, many=3000, data=st.data())
    def cards(data: Any) -> None:
        with Damage(model / "model.json", data):
            attempt(load, model)

    @fuzzed("files: model.zip", few=3, many=3000, data=st.data())
    def weights(data: Any) -> None:
        with Damage(model / "model.zip", data):
            attempt(load, model)

    cards()
    weights()


def test_the_shelf_is_read_or_refused(model: Path, place: Path) -> None:
    """A shelf with one agent, whose best.json is damaged."""
    from agents.models import shipped_agents
    from agents.policies.registry import make_policy

    directory = place / "shelf"
    shutil.copytree(model, directory / "ace")
    best = directory / "best.json"
    best.write_text(json.dumps({"best": "ace+tries=2"}))

    @fuzzed("files: best.json", few=3, many=2000, data=st.data())
    def case(data: Any) -> None:
        with Damage(best, data):
            attempt(make_policy, "best")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shipped_agents, "SHIPPED", directory)
        case()


TRAINED = {"ppo": "steps", "dagger": "states"}


@pytest.mark.parametrize("algorithm", TRAINED)
def test_a_training_is_taken_up_or_refused(
    place: Path, algorithm: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    train, directory = unfinished_training(place, algorithm)
    files = sorted(
        path for path in directory.rglob("*") if path.is_file() and "tensorboard" not in path.parts
    )
    assert len(files) >= 5

    @fuzzed(f"files: an unfinished training, {algorithm}", few=1, many=300, data=st.data())
    def case(data: Any) -> None:
        with Damage(data.draw(st.sampled_from(files)), data):
            attempt(train)

    case()


def unfinished_training(place: Path, algorithm: str) -> tuple[Callable[[], Any], Path]:
    """What prepares to go on with a training that was interrupted, and where that lies."""
    import yaml

    from agents.training import run as training
    from agents.training.run import ALGORITHMS, Run
    from tests.agents.training.test_run import OF_ALGORITHM, TINY

    own: dict[str, Any] = {"updates": 2, "first": 8, "expert": "pursuit"}
    recipe = {**TINY, **OF_ALGORITHM.get(algorithm, own)}
    config = place / f"{algorithm}.yml"
    config.write_text(yaml.safe_dump({ENVIRONMENT_ID: recipe}))
    chosen = ALGORITHMS[algorithm]
    asked = Run(
        algorithm=algorithm,
        directory=place / algorithm,
        hyperparameters=read_recipe(str(config), chosen.keys),
        chosen_on="sparse/validation:0",
        reported_on="sparse/validation:0",
    )

    def prepare() -> Any:
        if training.can_resume(asked) and training.finished(asked):
            return None
        return chosen.trainer().prepare(asked)

    from agents.training.learning_curve import TrainingRecord

    with pytest.MonkeyPatch.context() as patch:

        def stop(*_: object) -> None:
            raise KeyboardInterrupt

        patch.setattr(TrainingRecord, "finish", stop)
        with pytest.raises(KeyboardInterrupt):
            prepare()()
    return prepare, asked.directory

"""Files that would run code if they were unpickled: they are refused, and nothing runs."""

import ast
import base64
import io
import json
import pickle
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.places import ROOT

PACKAGES = ("ferguson_gym", "planners", "agents", "benchmarks")
_READERS = {
    "load": {"np": "allow_pickle=False", "torch": "weights_only=True"},
    "safe_load": {"yaml": ""},
}


def calls() -> list[tuple[str, str, str, str]]:
    """File, module, function and text of each call in the sources that might read pickles."""
    found = []
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if not isinstance(node, ast.Call):
                    continue
                function = node.func
                if isinstance(function, ast.Name) and function.id in ("eval", "exec"):
                    found.append((path.name, "builtins", function.id, ast.unparse(node)))
                if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
                    found.append((path.name, function.value.id, function.attr, ast.unparse(node)))
    return found


def test_whatever_might_unpickle_is_told_not_to() -> None:
    seen = set()
    for file, module, function, text in calls():
        if (module, function) == ("cloudpickle", "dumps"):
            continue  # it writes
        assert module not in ("pickle", "cloudpickle", "marshal", "shelve", "dill"), (file, text)
        assert (module, function) not in {("builtins", "eval"), ("builtins", "exec")}, (file, text)
        if module in ("np", "torch") and function == "load":
            assert _READERS["load"][module] in text, (file, text)
            seen.add(module)
        if (module, function) == ("npy", "read_array"):
            assert "allow_pickle=False" in text, (file, text)
            seen.add(module)
        if module == "yaml":
            assert function not in ("load", "load_all", "full_load", "unsafe_load"), (file, text)
            seen.add(module)
        if module in ("archive", "zipfile", "whole") and function in ("extract", "extractall"):
            pytest.fail(f"{file}: {text} writes where a file says")
    assert seen == {"np", "npy", "torch", "yaml"}


class Bomb:
    """Makes a file when it is unpickled."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.trace,)


@pytest.fixture
def trace(tmp_path: Path) -> Path:
    """The file that must never be there; it would be, were anything unpickled."""
    trace = tmp_path / "exploded"
    pickle.loads(pickle.dumps(Bomb(trace)))
    assert trace.exists()
    trace.unlink()
    return trace


def object_array(trace: Path) -> np.ndarray:
    array = np.empty(1, object)
    array[0] = Bomb(trace)
    return array


def weights(trace: Path, legacy: bool = False) -> bytes:
    torch = pytest.importorskip("torch")
    packed = io.BytesIO()
    bomb = {"log_std": Bomb(trace)}
    torch.save(bomb, packed, _use_new_zipfile_serialization=not legacy)
    return packed.getvalue()


def arm(file: Path, trace: Path) -> list[Callable[[], None]]:
    """Ways to put pickles into a file of its kind."""

    def zipped() -> None:
        with zipfile.ZipFile(file) as whole:
            names = whole.namelist()
        with zipfile.ZipFile(file, "w") as archive:
            for name in dict.fromkeys([*names, "pytorch_variables.pth", "../../outside.pth"]):
                archive.writestr(name, weights(trace))

    def data_alone() -> None:
        encoded = base64.b64encode(pickle.dumps(Bomb(trace))).decode()
        with zipfile.ZipFile(file) as whole:
            entries = {name: whole.read(name) for name in whole.namelist()}
        entries["data"] = json.dumps({"policy_class": {":serialized:": encoded}}).encode()
        with zipfile.ZipFile(file, "w") as archive:
            for name, content in entries.items():
                archive.writestr(name, content)

    def arrays() -> None:
        np.savez(file, **dict.fromkeys(np.load(file).files, object_array(trace)))  # type: ignore[arg-type]

    def array() -> None:
        np.save(file, object_array(trace))

    def state() -> None:
        file.write_bytes(weights(trace))

    def legacy() -> None:
        file.write_bytes(weights(trace, legacy=True))

    def plain() -> None:
        file.write_bytes(pickle.dumps(Bomb(trace)))

    own = {
        ".zip": [zipped, data_alone],
        ".npz": [arrays],
        ".npy": [array],
        ".pt": [state, legacy],
        ".pth": [state, legacy],
    }
    return [*own.get(file.suffix, []), plain]


@pytest.mark.parametrize("algorithm", ["ppo", "tqc", "dagger"])
def test_a_training_is_not_taken_up_from_pickles(
    algorithm: str, trace: Path, tmp_path: Path
) -> None:
    pytest.importorskip("sb3_contrib")
    pytest.importorskip("yaml")
    from tests.fuzz.test_files import unfinished_training

    prepare, directory = unfinished_training(tmp_path, algorithm)
    whole = tmp_path / "whole"
    shutil.copytree(directory, whole)
    files = [path.relative_to(directory) for path in directory.rglob("*") if path.is_file()]
    kinds = {file.suffix for file in files if "tensorboard" not in file.parts}
    assert kinds >= ({".npy", ".pt"} if algorithm == "dagger" else {".zip", ".json"})
    for file in files:
        for armed in arm(directory / file, trace) if "tensorboard" not in file.parts else []:
            armed()
            try:
                prepare()
            except ValueError as error:
                assert str(error)  # noqa: PT017 (it may go on, where it does not look)
            assert not trace.exists(), (file, armed)
            shutil.copy(whole / file, directory / file)
    assert not (tmp_path.parent / "outside.pth").exists()


def test_a_model_to_begin_with_is_not_unpickled(trace: Path, tmp_path: Path) -> None:
    pytest.importorskip("sb3_contrib")
    from agents.cli.main import main
    from tests.support.small_models import saved

    start = saved(tmp_path / "start")
    whole = (start / "model.zip").read_bytes()
    for armed in arm(start / "model.zip", trace):
        (start / "model.zip").write_bytes(whole)
        armed()
        out = tmp_path / "out"
        main(["train", "ppo", "--from", str(start), "--out", str(out), "--demos", "x"])
        main(["evaluate", "--policy", str(start), "--fields", "x", "--out", str(out)])
        assert not trace.exists()
        assert not out.exists()


def test_a_model_takes_no_more_memory_or_time_than_a_network_may(tmp_path: Path) -> None:
    pytest.importorskip("sb3_contrib")
    from agents.models import torch_model
    from agents.models.loading import load
    from tests.support.small_models import saved

    place = saved(tmp_path / "model")
    card = json.loads((place / "model.json").read_text())
    (place / "model.json").write_text(json.dumps(card | {"policy_kwargs": {"net_arch": [10**9]}}))
    for loaded in (load, torch_model.load):
        with pytest.raises(ValueError, match=r"at most .* (weights|units|are read)"):
            loaded(place)
    (place / "model.json").write_text(json.dumps(card))
    with (
        zipfile.ZipFile(place / "model.zip", "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("policy.pth", "w") as file,
    ):
        for _ in range(300):
            file.write(bytes(1_000_000))
    assert (place / "model.zip").stat().st_size < 1_000_000
    with pytest.raises(ValueError, match=r"300,000,000 bytes of weights; at most 256,000,000"):
        load(place)


def test_results_and_chunks_are_not_unpickled(trace: Path, tmp_path: Path) -> None:
    from agents.evaluation import work as evaluation_work
    from agents.evaluation.report.page import write_report
    from agents.evaluation.request import Request
    from agents.evaluation.run import run
    from agents.runtime.executors import Backend

    request = Request(policies=["single-start"], fields=["sparse/train:0"], seeds=[0])
    work = evaluation_work.Work(tmp_path / "unfinished", request)
    list(evaluation_work.fly(work, work.begin(), Backend()))
    for armed in arm(work.store.file(0), trace):
        armed()
        with pytest.raises(OSError, match="is damaged"):
            work.table()
    run(request, tmp_path / "results", Backend())
    for armed in arm(tmp_path / "results/paths.npz", trace):
        armed()
        with pytest.raises(ValueError, match=r"paths\.npz does not hold the paths of flights"):
            write_report(tmp_path / "results")
    assert not trace.exists()


def test_demonstrations_are_not_unpickled_nor_their_environment_imported(
    trace: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("minari")
    from agents.cli.main import main
    from agents.demonstrations.reading import read

    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    name = "ferguson/hostile-v0"
    assert main(["demos", "--expert", "pursuit", "--fields", "sparse/train:0", "--out", name]) == 0
    place = tmp_path / name / "data/metadata.json"
    told = json.loads(place.read_text())
    (tmp_path / "hostile.py").write_text(f"open({str(trace)!r}, 'w').close()\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    spec = json.loads(told["env_spec"])
    assert spec["id"] == "ferguson/ObstacleField-v0"
    spec["entry_point"] = "hostile:Environment"
    spec["vector_entry_point"] = "hostile:Environment"
    spec["additional_wrappers"] = [
        {"name": "Hostile", "entry_point": "hostile:Wrapper", "kwargs": {}}
    ]
    place.write_text(json.dumps(told | {"env_spec": json.dumps(spec)}))
    assert read(name).fields == ("sparse/train:0",)  # the environment of this id, and no other
    spec["id"] = "hostile:Environment-v0"
    place.write_text(json.dumps(told | {"env_spec": json.dumps(spec)}))
    with pytest.raises(ValueError, match="need demonstrations in ferguson/ObstacleField-v0"):
        read(name)
    place.write_text(json.dumps(told))
    for armed in arm(place.with_name("main_data.hdf5"), trace):
        armed()
        with pytest.raises(ValueError, match="damaged"):
            read(name)
    assert not trace.exists()


def test_hyperparameters_are_data(trace: Path, tmp_path: Path) -> None:
    pytest.importorskip("yaml")
    from agents.training.hyperparameters import read

    file = tmp_path / "recipe.yml"
    file.write_text(f"!!python/object/apply:pathlib.Path.touch [!!python/str {str(trace)!r}]")
    with pytest.raises(ValueError, match="not YAML"):
        read(str(file), set())
    assert not trace.exists()


def test_aliases_in_hyperparameters_are_limited_before_they_expand(tmp_path: Path) -> None:
    pytest.importorskip("yaml")
    from agents.training.hyperparameters import read

    levels = "".join(f"a{k}: &a{k} [*a{k - 1}, *a{k - 1}]\n" for k in range(1, 60))
    file = tmp_path / "recipe.yml"
    file.write_text(f"a0: &a0 [1]\n{levels}")
    with pytest.raises(ValueError, match=r"not YAML \(more than 10 aliases\)"):
        read(str(file), set())
    file.write_text(
        "ferguson/ObstacleField-v0: {n_envs: &n 4, n_timesteps: *n, eval_freq: *n, policy: mlp}"
    )
    found = read(str(file), set())
    assert (found.n_envs, found.n_timesteps, found.eval_freq) == (4, 4, 4)

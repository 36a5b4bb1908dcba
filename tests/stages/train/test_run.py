"""Training end to end on a real bag: it learns, goes on after a stop, and refuses bad input."""

from __future__ import annotations

import csv
import multiprocessing
import os
import shutil
import signal
from pathlib import Path

import numpy as np
import pytest
import torch

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.stages.train import run
from advpipe.stages.train.config import Augmentation, TrainConfig
from advpipe.stages.train.learning_rate import learning_rate


def configured(drive: Path, out: Path, **changes: object) -> TrainConfig:
    settings = {"steps": 4, "checkpoint_every": 100, "preset": "tiny", "workers": 1, **changes}
    return TrainConfig(bags=(drive,), out=out, **settings)


def test_training_overfits_a_frame(record, tiny, tmp_path):
    drive = record(tmp_path / "bag", frames=1, seed=1)
    learning = {"steps": 90, "batch_size": 1, "augmentation": Augmentation.none()}
    config = configured(drive, tmp_path / "run", validation=drive, validate_every=40, **learning)
    summary = run.train(config)
    assert summary.frames == 1
    assert load_detector(str(summary.checkpoint)).provenance["steps"] == "90"
    for precision in summary.precision.values():
        assert precision.boxes == 1
        assert precision.strict_percent == pytest.approx(100)
    assert sorted(p.name for p in config.out.iterdir()) == [
        "config.json",
        "detector.safetensors",
        "train.csv",
        "training.png",
        "validation.csv",
    ]
    assert summary.picture.read_bytes().startswith(b"\x89PNG")
    assert steps_of(config.out / "validation.csv") == [39, 79, 89]


def steps_of(log: Path) -> list[int]:
    with log.open(newline="") as file:
        return [int(row["step"]) for row in csv.DictReader(file)]


def test_two_processes_and_an_interruption_change_no_byte(drive, tiny, tmp_path, monkeypatch):
    whole = run.train(configured(drive, tmp_path / "whole"))

    # Ctrl-C during the second step: that step is finished and saved.
    step = run.train_step

    def interrupted_step(state, *arguments):
        if state.step == 1:
            os.kill(os.getpid(), signal.SIGINT)
        return step(state, *arguments)

    config = configured(drive, tmp_path / "parts", workers=2)
    with monkeypatch.context() as patch:
        patch.setattr(run, "train_step", interrupted_step)
        with pytest.raises(KeyboardInterrupt):
            run.train(config)
    assert not (config.out / "detector.safetensors").exists()
    assert steps_of(config.out / "train.csv") == [0, 1]
    resumed = run.train(config)
    assert resumed.checkpoint.read_bytes() == whole.checkpoint.read_bytes()
    assert resumed.log.read_bytes() == whole.log.read_bytes()
    assert not multiprocessing.active_children()


def test_a_killed_run_resumes_from_its_last_state(drive, tiny, tmp_path, monkeypatch):
    whole = run.train(configured(drive, tmp_path / "whole", checkpoint_every=2))
    step = run.train_step

    def dying_step(state, *arguments):
        if state.step == 3:
            raise MemoryError
        return step(state, *arguments)

    config = configured(drive, tmp_path / "parts", checkpoint_every=2)
    with monkeypatch.context() as patch:
        patch.setattr(run, "train_step", dying_step)
        with pytest.raises(MemoryError):
            run.train(config)
    assert steps_of(config.out / "train.csv") == [0, 1, 2]
    resumed = run.train(config)
    assert steps_of(resumed.log) == [0, 1, 2, 3]
    assert resumed.checkpoint.read_bytes() == whole.checkpoint.read_bytes()


def test_a_run_killed_in_its_last_validation_or_later_gives_the_same_files(
    drive, tiny, tmp_path, monkeypatch
):
    config = configured(drive, tmp_path / "run", steps=2, validation=drive)

    def die(*_):
        raise MemoryError

    # After the row of the last validation, and again after the checkpoint.
    for owner, name in ((run, "plot_training"), (run.RunFolder, "tidy")):
        with monkeypatch.context() as patch:
            patch.setattr(owner, name, die)
            with pytest.raises(MemoryError):
                run.train(config)
        assert steps_of(config.out / "validation.csv") == [1]
    with pytest.raises(OutputExistsError):
        run.train(config)
    files = ["config.json", "detector.safetensors", "train.csv", "training.png", "validation.csv"]
    assert sorted(p.name for p in config.out.iterdir()) == files


def test_another_seed_gives_other_weights(drive, tiny, tmp_path):
    a, b = (run.train(configured(drive, tmp_path / str(s), seed=s, steps=1)) for s in (0, 1))
    assert a.checkpoint.read_bytes() != b.checkpoint.read_bytes()


def test_a_run_may_start_from_a_checkpoint(drive, tiny, tmp_path):
    first = run.train(configured(drive, tmp_path / "first", steps=1)).checkpoint
    begun = run.new_net(configured(drive, tmp_path / "second", start=first)).state_dict()
    for name, value in load_detector(str(first)).net.state_dict().items():
        assert torch.equal(begun[name], value)
    second = run.train(configured(drive, tmp_path / "second", steps=1, start=first)).checkpoint
    assert len(load_detector(str(second)).provenance["start"]) == 64
    with pytest.raises(AdvpipeError, match="no detector checkpoint at"):
        run.train(configured(drive, tmp_path / "third", start=tmp_path / "none.safetensors"))


def test_a_finished_run_is_not_overwritten_without_the_option(drive, tiny, tmp_path, monkeypatch):
    config = configured(drive, tmp_path / "run", steps=1)
    first = run.train(config).checkpoint.read_bytes()

    def hashed(bag):
        raise AssertionError(f"{bag} is large; nobody has to hash it to refuse")

    with monkeypatch.context() as patch:
        patch.setattr(run, "parent_sha256", hashed)
        with pytest.raises(OutputExistsError):
            run.train(config)
    assert run.train(config, overwrite=True).checkpoint.read_bytes() == first


def test_folders_with_other_contents_are_refused(drive, tiny, tmp_path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "a.jpg").touch()
    with pytest.raises(AdvpipeError, match="is not a training run"):
        run.train(configured(drive, tmp_path / "photos"), overwrite=True)
    (tmp_path / "model" / "frames").mkdir(parents=True)
    (tmp_path / "model" / "config.json").write_text('{"architectures": ["another"]}')
    with pytest.raises(AdvpipeError, match="is not a training run"):
        run.train(configured(drive, tmp_path / "model"), overwrite=True)
    with pytest.raises(AdvpipeError, match="is a file"):
        run.train(configured(drive, tmp_path / "photos" / "a.jpg"))


def unfinished(config: TrainConfig, monkeypatch) -> None:
    """One step is done and saved, as ctrl-C does."""
    step = run.train_step

    def stop(state, *arguments):
        if state.step == 1:
            state.save(config.out / "state.pt")
            raise MemoryError
        return step(state, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(run, "train_step", stop)
        with pytest.raises(MemoryError):
            run.train(config)


def test_an_unfinished_run_resumes_only_with_its_configuration(drive, tiny, tmp_path, monkeypatch):
    unfinished(configured(drive, tmp_path / "run"), monkeypatch)
    with pytest.raises(AdvpipeError, match="another configuration"):
        run.train(configured(drive, tmp_path / "run", seed=3))
    run.train(configured(drive, tmp_path / "run", seed=3, steps=1), overwrite=True)


def test_an_unfinished_run_does_not_resume_with_another_bag_of_the_same_name(
    record, tiny, tmp_path, monkeypatch
):
    drive = record(tmp_path / "bag", frames=2, seed=1)
    unfinished(configured(drive, tmp_path / "run"), monkeypatch)
    shutil.rmtree(drive)
    record(drive, frames=2, seed=2)
    with pytest.raises(AdvpipeError, match="another configuration or other bags"):
        run.train(configured(drive, tmp_path / "run"))


def test_an_unfinished_run_does_not_resume_with_another_start_checkpoint(drive, tiny, tmp_path, monkeypatch):
    first, second = (
        run.train(configured(drive, tmp_path / str(seed), steps=1, seed=seed)).checkpoint for seed in (0, 1)
    )
    unfinished(configured(drive, tmp_path / "run", start=first), monkeypatch)
    first.write_bytes(second.read_bytes())
    with pytest.raises(AdvpipeError, match="another configuration"):
        run.train(configured(drive, tmp_path / "run", start=first))


def test_a_damaged_state_is_a_one_line_error(drive, tiny, tmp_path, monkeypatch):
    config = configured(drive, tmp_path / "run")
    unfinished(config, monkeypatch)
    (config.out / "state.pt").write_bytes(b"no state")
    with pytest.raises(AdvpipeError, match="cannot resume from"):
        run.train(config)


def test_a_loss_that_is_not_finite_stops_the_run(drive, tiny, tmp_path, monkeypatch):
    def explode(net, *_):
        def gradients_of(step):
            for parameter in net.parameters():
                parameter.grad = torch.full_like(parameter, float("nan"))
            return torch.full((3,), float("nan"))

        class Context:
            def __enter__(self):
                return gradients_of

            def __exit__(self, *_):
                return None

        return Context()

    monkeypatch.setattr(run, "gradients", explode)
    with pytest.raises(AdvpipeError, match="not finite at step 0"):
        run.train(configured(drive, tmp_path / "run"))


def test_bags_without_ground_truth_or_clouds_are_refused(tiny, tmp_path):
    ego = VehicleTopics("ego")
    with BagWriter(tmp_path / "bare", provenance={}) as bag:
        bag.write_cdr(ego.lidar_points, cloud_to_cdr(np.zeros(3, POINT_DTYPE), 0, ego.lidar_frame), 0)
    with pytest.raises(AdvpipeError, match="no ground truth"):
        run.train(configured(tmp_path / "bare", tmp_path / "run"))
    with BagWriter(tmp_path / "blind", provenance={}) as bag:
        bag.write(ego.objects, build.detections_message(0, ego.lidar_frame, Boxes()), 0)
    with pytest.raises(AdvpipeError, match="no LiDAR clouds"):
        run.train(configured(tmp_path / "blind", tmp_path / "run"))
    with pytest.raises(AdvpipeError, match="does not exist"):
        run.train(configured(tmp_path / "missing", tmp_path / "run"))
    assert not (tmp_path / "run").exists()


def test_a_failing_process_is_reported_in_one_line(drive, tiny, tmp_path, monkeypatch):
    from advpipe.stages.train.examples import Examples

    def broken(self, place):
        raise ValueError("no such frame")

    monkeypatch.setattr(Examples, "__getitem__", broken)
    with pytest.raises(AdvpipeError, match="stopped at step 0: ValueError: no such frame"):
        run.train(configured(drive, tmp_path / "run", workers=2))


def test_learning_rate_warms_up_and_decays():
    config = TrainConfig(bags=(Path("a"),), out=Path("b"), learning_rate=1.0, warmup=0.1)
    rates = [learning_rate(step, 100, config.learning_rate, config.warmup) for step in (0, 5, 10, 55, 99)]
    assert rates == pytest.approx([0.1, 0.55, 1.0, 0.5005, 0.0013], abs=1e-3)


def test_a_second_run_in_the_same_folder_is_refused(drive, tiny, tmp_path, monkeypatch):
    """The second one is refused at once, and the first one finishes as if it had been alone."""
    alone = run.train(configured(drive, tmp_path / "alone", steps=1)).checkpoint.read_bytes()
    config, step = configured(drive, tmp_path / "run", steps=1), run.train_step

    def meanwhile(*arguments):
        monkeypatch.setattr(run, "train_step", step)
        for overwrite in (False, True):
            with pytest.raises(AdvpipeError, match="run is locked by another run; wait until it ends"):
                run.train(config, overwrite=overwrite)
        return step(*arguments)

    monkeypatch.setattr(run, "train_step", meanwhile)
    assert run.train(config).checkpoint.read_bytes() == alone
    assert not list(config.out.glob(".*"))


@pytest.mark.parametrize("rate", [1e30, 1e6])
def test_a_run_that_diverges_in_its_first_step_leaves_nothing(drive, tiny, tmp_path, rate):
    for steps in (1, 4):
        with pytest.raises(AdvpipeError, match=r"not finite at step [1-4], .*lower learning_rate"):
            run.train(configured(drive, tmp_path / "new" / "run", learning_rate=rate, steps=steps))
        assert not (tmp_path / "new").exists()
    run.train(configured(drive, tmp_path / "new" / "run", steps=1))


def test_a_failure_before_the_first_state_leaves_nothing(drive, tiny, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    (tmp_path / "run").mkdir()
    for name in ("store_frames", "gradients", "train_step"):
        with monkeypatch.context() as patch:
            patch.setattr(run, name, full)
            with pytest.raises(OSError, match="No space left"):
                run.train(configured(drive, tmp_path / "run"))
        assert not list((tmp_path / "run").iterdir())


def test_a_run_killed_before_its_first_state_can_be_started_again(drive, tiny, tmp_path):
    """As it lies there after a kill: with another configuration, nothing is lost."""
    out = tmp_path / "run"
    (out / ".frames.partial-abcdefgh").mkdir(parents=True)
    (out / ".lock").touch()
    (out / ".config.json.advpipe-partial-01234567").touch()
    run.train(configured(drive, out, steps=1))
    assert not list(out.glob(".*"))
    (out / "detector.safetensors").unlink()  # killed when config.json and the logs were there
    run.train(configured(drive, out, steps=1, seed=2))

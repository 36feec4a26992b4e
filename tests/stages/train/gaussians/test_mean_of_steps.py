"""The mean of the last steps."""

import numpy as np

from gsac.stages.train.fast.cpu import Cpu
from gsac.stages.train.fast.schedule import averaged_from
from gsac.stages.train.fast.trainer import Trainer
from gsac.stages.train.gaussians.mean_of_steps import MeanOfSteps
from support.train_task import task_of


def test_the_mean_of_steps_is_their_mean_and_leaves_them_alone():
    mean, steps = MeanOfSteps(), [np.full((2, 3), value, np.float32) for value in (1, 2, 6)]
    for step in steps:
        mean.add({"mu": step})
    np.testing.assert_array_equal(mean.values()["mu"], np.full((2, 3), 3, np.float32))
    assert mean.values()["mu"].dtype == np.float32
    assert [step[0, 0] for step in steps] == [1, 2, 6]


def test_a_mean_that_was_kept_goes_on():
    whole, first, second = MeanOfSteps(), MeanOfSteps(), MeanOfSteps()
    values = np.random.default_rng(0).random((4, 5, 3)).astype(np.float32)
    for step in values:
        whole.add({"rgb": step})
    for step in values[:2]:
        first.add({"rgb": step})
    second.restore(first.state())
    for step in values[2:]:
        second.add({"rgb": step})
    np.testing.assert_array_equal(second.values()["rgb"], whole.values()["rgb"])


def test_of_however_few_steps_the_last_one_is_averaged():
    assert [averaged_from(steps, device) for steps in (1, 2, 3) for device in ("cpu", "cuda")] == [0, 0, 1, 1, 2, 2]
    assert averaged_from(1200, "cpu") == 1080
    assert averaged_from(6000, "cuda") == 4800


def test_a_training_hands_out_the_mean_of_its_last_steps(job, monkeypatch):
    learn, seen = Trainer.learn, []

    def watched(self, steps):
        losses = learn(self, steps)
        seen.append({name: value.copy() for name, value in self.values.items()})
        return losses

    monkeypatch.setattr(Trainer, "learn", watched)
    trained = Cpu().train(task_of(job(steps=40), held=(3, 8)), 200)
    assert len(seen) == 20
    for name, value in trained.trainer.values.items():
        np.testing.assert_array_equal(value, np.mean([step[name] for step in seen[-2:]], 0, dtype=np.float64).astype(np.float32))

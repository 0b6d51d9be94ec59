"""Times in steps: durations, intervals, and what comes after which step."""

import pytest

from multicor_cli.running.conditions import is_due
from multicor_cli.running.from_scenario import count_steps, fit_steps


@pytest.mark.parametrize(("duration", "dt", "steps", "end"), [
    (1.0, 0.1, 10, None), (0.3, 0.1, 3, None), (1.0 + 1e-10, 0.1, 10, None),
    (1.0 - 1e-10, 0.1, 10, None), (1e6, 1e-4, 10_000_000_000, None), (1.5, 1.0, 2, 1.5),
    (1.05, 1.0, 1, 1.05),  # less than a tenth is left
    (1.15, 1.0, 2, 1.15), (2.95, 1.0, 3, 2.95), (7.0 - 1e-6, 1.0, 7, 7.0 - 1e-6),
    (7.0 + 1e-6, 1.0, 7, 7.0 + 1e-6), (0.3, 1.0, 1, 0.3),
])  # fmt: skip
def test_steps_fit_a_duration(duration, dt, steps, end):
    assert fit_steps(duration, dt) == (steps, end)
    last = (duration if end else steps * dt) - (steps - 1) * dt
    assert 0.0999 * dt <= last <= 1.1 * dt or duration < dt


@pytest.mark.parametrize(
    ("interval", "dt", "steps"),
    [(1.0, 0.1, 10), (0.3, 0.1, 3), (1e-3, 0.1, 1), (0.25, 0.1, 2.5), (0.1 + 1e-12, 0.1, 1)],
)
def test_steps_of_an_interval(interval, dt, steps):
    assert count_steps(interval, dt) == pytest.approx(steps, rel=1e-15)


@pytest.mark.parametrize("every", [1, 2, 7, 1.04, 1.5, 2.5, 3.3, 16.9, 1000.0 / 7.0])
def test_what_is_wanted_again_and_again_comes_after_the_nearest_step(every):
    """Each time once, within half a step, however often; whole numbers as ever."""
    due = [step for step in range(1, 5_000) if is_due(step, every)]
    assert len(due) == pytest.approx(5_000 / every, abs=2)
    assert max(abs(step - (k + 1) * every) for k, step in enumerate(due)) <= 0.5 + 1e-9
    if isinstance(every, int):
        assert due == [step for step in range(1, 5_000) if step % every == 0]

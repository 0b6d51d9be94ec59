"""Residence times: plug flow, survival by hand, and what cannot be known."""

from types import SimpleNamespace

import numpy as np
import pytest
from made_up_frames import source_of
from made_up_groups import LAPSE, source_of_stays
from scene_parts import make_model

from multicor_cli.post import PostError, Selection, residence

pytest.importorskip("scipy")


def test_plug_flow():
    """A grain comes in with each frame and stays for four."""
    table = residence(source_of_stays([(k, k + 3) for k in range(1, 11)], 20))
    assert (table.stays[0], table.ended[0], table.first, table.lost) == (10, 10, 0, 0)
    assert table.mean[0] == table.median[0] == table.longest[0] == pytest.approx(4 * LAPSE)
    assert table.error[0] == pytest.approx(0.0, abs=1e-12)
    assert table.survival[0].share.tolist() == [0.0]
    assert table.stay.start == pytest.approx(LAPSE * (np.arange(1, 11) - 0.5))
    assert table.interval == LAPSE
    assert [row[0] for row in table.rows] == ["all", "grains"]


def test_survival_by_hand():
    """Stays of 1, 2, 2, 3+ and 4+ half seconds: S falls to 4/5 and 4/5 · 2/4."""
    stays = [(9, 9), (5, 6), (6, 7), (9, 11), (8, 11)]
    table = residence(source_of_stays(stays, 12))
    # those that are there at the end count up to the last frame, half an interval less
    assert np.sort(table.stay.duration / LAPSE) == pytest.approx([1.0, 2.0, 2.0, 2.5, 3.5])
    assert table.stay.is_censored.sum() == 2
    curve = table.survival[0]
    assert curve.time / LAPSE == pytest.approx([1.0, 2.0, 2.5, 3.5])
    assert curve.share == pytest.approx([0.8, 0.4, 0.4, 0.4])
    mean = 1.0 + 0.8 * 1.0 + 0.4 * 1.5
    assert table.mean[0] == pytest.approx(LAPSE * mean)
    assert table.median[0] == pytest.approx(2 * LAPSE)
    variance = (mean - 1.0) ** 2 * 1 / (5 * 4) + (0.4 * 1.5) ** 2 * 2 / (4 * 2)
    assert table.error[0] == pytest.approx(LAPSE * np.sqrt(variance))
    # Greenwood: S² Σ d/(r (r − d))
    scatter = 0.4 * np.sqrt(1 / (5 * 4) + 2 / (4 * 2))
    assert curve.high[1] == pytest.approx(0.4 + scatter, rel=1e-3)


def test_nobody_is_censored_then_it_is_the_mean():
    random = np.random.default_rng(1)
    start, length = random.integers(1, 40, 60), random.integers(1, 30, 60)
    table = residence(source_of_stays(list(zip(start, start + length - 1, strict=True)), 80))
    assert table.mean[0] == pytest.approx(LAPSE * length.mean())
    assert table.error[0] == pytest.approx(LAPSE * length.std() / np.sqrt(60))
    assert table.median[0] == pytest.approx(LAPSE * np.sort(length)[29])


def test_censoring_does_not_shorten_stays():
    """Exponential stays of which the frames see the beginnings of most and the ends of half."""
    random = np.random.default_rng(2)
    start, length = random.integers(1, 60, 3000), random.geometric(1.0 / 30.0, 3000)
    table = residence(source_of_stays(list(zip(start, start + length - 1, strict=True)), 61))
    assert 0.4 < table.ended[0] / table.stays[0] < 0.7
    share, time = table.survival[0].share, table.survival[0].time / LAPSE
    true = (1.0 - 1.0 / 30.0) ** time
    assert np.abs(share - true)[time < 40].max() < 0.05
    seen = table.stay.duration[~table.stay.is_censored].mean() / LAPSE
    assert seen < 20.0  # of 30


def test_groups_and_who_does_not_count():
    """One grain was there at first, one is lost, one goes round."""
    stays = [(0, 5), (1, 2), (1, 4), (2, 4)]
    source = source_of_stays(stays, 8, groups=[0, 0, 1, 1], lost=(3,))
    table = residence(source)
    assert (table.first, table.lost) == (1, 1)
    assert list(table.group) == ["all", "a", "b"]
    assert table.stays.tolist() == [3, 1, 2]
    assert table.ended.tolist() == [2, 1, 1]
    assert np.isnan(table.error[1])
    assert table.stay.grain[table.stay.is_censored].tolist() == [3]
    assert {row[1] for row in table.detail_rows} == {"a", "b"}
    assert set(table.as_dict()["survival_over_time"]) == {"all", "a", "b"}
    # between frames 3 and 4 grain 2 is taken and released far away: two stays
    frame = source.frames[4]
    frame.unwrapped = frame.unwrapped + np.where(frame.number == 2, 50.0, 0.0)[:, np.newaxis]
    again = residence(source)
    own = again.stay.grain == 2
    assert again.stay.duration[own] / LAPSE == pytest.approx([3.0, 1.0])


def test_what_has_no_residence_is_said():
    closed = source_of(make_model([0.1]), [SimpleNamespace(number=np.arange(1))] * 4)
    with pytest.raises(PostError, match="no grain comes or goes"):
        residence(closed)
    source = source_of_stays([(0, 5), (7, 8)], 12)
    with pytest.raises(PostError, match="three frames, not 2"):
        residence(source, Selection(frames=slice(0, 2)))
    with pytest.raises(PostError, match="no grain comes in between"):
        residence(source, Selection(frames=slice(0, 6)))
    assert residence(source).stays.tolist() == [1, 1]

"""What a sweep says: Pareto fronts against their definition, medians, and what figures show."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from matplotlib import pyplot as plt

import miplight as ml


def _front_by_definition(df: pd.DataFrame) -> set[int]:
    """Rows that no other row beats: no worse in both, better in one."""
    rows = [(i, t, e) for i, t, e in zip(df.index, df["ms"], df["relative_rmse"], strict=True)]
    rows = [(i, t, e) for i, t, e in rows if not (np.isnan(t) or np.isnan(e))]

    def beaten(t: float, e: float) -> bool:
        return any(u <= t and f <= e and (u < t or f < e) for _, u, f in rows)

    return {i for i, t, e in rows if not beaten(t, e)}


@pytest.mark.parametrize("size", [0, 1, 7, 60])
def test_the_front_is_what_nothing_beats(rng: np.random.Generator, size: int) -> None:
    for _ in range(20):
        # small whole numbers: many ties in time, in error and in both
        values = rng.integers(1, 9, (size, 2)).astype(np.float64)
        values[rng.uniform(size=(size, 2)) < 0.1] = np.nan
        df = pd.DataFrame(values, columns=["ms", "relative_rmse"], index=rng.permutation(size) + 100)
        front = ml.study.pareto(df)
        assert set(front.index) == _front_by_definition(df)
        assert front["ms"].is_monotonic_increasing
        assert front["relative_rmse"].is_monotonic_decreasing
        pd.testing.assert_frame_equal(front, df.loc[front.index])


def test_the_front_of_other_columns() -> None:
    df = pd.DataFrame({"rays": pd.array([3, 1, None, 2], "Int64"), "median": [1.0, 3.0, 0.0, 3.0]})
    assert list(ml.study.pareto(df, "rays", "median").index) == [1, 0]
    with pytest.raises(ml.SettingsError, match="did you mean 'median'"):
        ml.study.pareto(df, "rays", "medians")
    with pytest.raises(ml.SettingsError, match="df is None"):
        ml.study.pareto(None)


def _sweep_like() -> pd.DataFrame:
    rows = [
        # point, preset, repeat, ms, ms:direct, relative_rmse, error
        ("b", "x", 0, 9.0, 5.0, 0.1, None),
        ("b", "x", 1, 2.0, 1.0, 0.1, None),
        ("b", "x", 2, 4.0, 3.0, 0.1, None),
        ("a", "y", 0, np.nan, np.nan, np.nan, "lost"),
        ("a", "y", 1, 8.0, 6.0, 0.2, None),
        ("c", "x", 0, np.nan, np.nan, np.nan, "lost"),
    ]
    return pd.DataFrame(
        rows, columns=["point", "preset", "repeat", "ms", "ms:direct", "relative_rmse", "error"]
    )


def test_medians_join_repeats() -> None:
    df = ml.study.medians(_sweep_like())
    assert list(df["point"]) == ["b", "a", "c"]
    assert list(df["ms"][:2]) == [4.0, 8.0]
    assert list(df["ms:direct"][:2]) == [3.0, 6.0]
    assert np.isnan(df["ms"][2])
    assert list(df["error"].notna()) == [False, False, True]
    assert list(df.columns) == list(_sweep_like().columns)


def test_a_plot_has_a_curve_for_each_preset_and_the_front() -> None:
    ax = ml.study.plot(_sweep_like())
    assert ax.get_xscale() == ax.get_yscale() == "log"
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["x", "y", "Pareto front"]
    curve, other, front = ax.get_lines()
    assert curve.get_xydata().tolist() == [[4.0, 0.1]]
    assert other.get_xydata().tolist() == [[8.0, 0.2]]
    assert front.get_xydata().tolist() == [[4.0, 0.1]]
    assert "ms" in ax.get_xlabel()
    given = plt.figure().add_subplot()
    assert ml.study.plot(_sweep_like(), given) is given
    with pytest.raises(ml.SettingsError, match="no row with ms and relative_rmse above zero"):
        ml.study.plot(_sweep_like().assign(relative_rmse=np.nan))
    plt.close("all")


def test_places_have_curves_of_their_own() -> None:
    df = _sweep_like().assign(camera=["f", "f", "f", "g", "g", "g"])
    labels = [text.get_text() for text in ml.study.plot(df).get_legend().get_texts()]
    assert labels == ["x, f", "y, g", "Pareto front"]
    plt.close("all")


def test_a_frame_beside_its_reference(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, quick: ml.Settings
) -> None:
    frame = renderer.render(room, camera, quick)
    reference = frame.image * np.float32(1.25)
    figure = ml.study.compare(frame, reference)
    image, truth, error, fragments, *_ = figure.axes
    assert np.asarray(image.images[0].get_array()).shape == (36, 48, 3)
    assert np.asarray(truth.images[0].get_array()).mean() > np.asarray(image.images[0].get_array()).mean()
    shown = error.images[0].get_array()
    assert (np.ma.getmaskarray(shown) == ~frame.surface_mask).all()
    mask = frame.surface_mask
    expected = np.abs(frame.image - reference).mean(axis=-1)[mask] / reference[mask].mean()
    np.testing.assert_allclose(shown.compressed(), expected, rtol=1e-5)
    assert "relative RMSE" in error.get_title()
    assert "fragments" in fragments.get_title()
    with pytest.raises(ml.SettingsError, match="shape"):
        ml.study.compare(frame, reference[1:])
    plt.close("all")

"""blend_trials: poses, lengths of limbs, headings, paths, timing, and kinds of input."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    Match,
    Skeleton,
    to_trials,
)
from sklearn_motionsync.synchronizers import blend_trials

import made_bodies
from made_bodies import turned, with_still_root

PAPER = Skeleton.paper()
FORMATS = ("paper", "acclaim", "kinect", "kinect_v2", "mediapipe", "plug_in_gait")


@pytest.fixture(scope="module")
def pipe(bending):
    steps = DirectionCosines(bending.skeleton), ASpace(), DenseSynchronizer(n_frames=60)
    return make_pipeline(*steps).fit(bending.data[:12])


def even(*lengths, n_frames=50):
    """A match at the uniform pace of the pattern."""
    return Match(np.tile(np.arange(float(n_frames)), (len(lengths), 1)))


def lengths_of(x, skeleton, names=("thigh", "leg", "arm", "forearm")):
    """(n_frames, n_limbs) by the places of joints: of the two sides, hips, shoulders and trunk."""
    ends = {"thigh": ("hip", "knee"), "leg": ("knee", "ankle")}
    ends |= {"arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist")}
    pairs = [tuple(f"{s}_{j}" for j in ends[n]) for n in names for s in ("left", "right")]
    pairs += [(f"left_{j}", f"right_{j}") for j in ("hip", "shoulder")]
    pairs += [("pelvis", "neck"), ("neck", "head")]
    joints = x.reshape(len(x), -1, skeleton.n_dims)
    at = [[joints[:, skeleton.indices_of(n)].mean(axis=1) for n in pair] for pair in pairs]
    return np.stack([np.linalg.norm(a - b, axis=1) for a, b in at], axis=1)


def walker(n_frames, size=1.0, seed=0):
    """A body that walks along z, of rigid limbs, all of its directions moving; metres."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, n_frames)[:, np.newaxis]
    cosines = DirectionCosines(PAPER).fit(size * standing(2))
    (names,) = cosines.transform([standing(2)])
    moves = rng.normal(scale=0.15, size=(2, names.shape[1])) * [[1], [0.5]]
    moves[:, :4] = 0
    poses = names[:1] + moves[0] * np.sin(6 * t) + moves[1] * np.cos(9 * t)
    x = cosines.inverse_transform(poses).reshape(n_frames, -1, 3)
    x[..., 2] += size * 1.5 * t
    return x.reshape(n_frames, -1)


def standing(n_frames):
    bent = {f"{side}_wrist": (x, 0.9, 0.1) for side, x in (("left", 0.2), ("right", -0.2))}
    bent |= {f"{side}_knee": (x, 0.5, 0.1) for side, x in (("left", 0.1), ("right", -0.1))}
    return np.repeat(made_bodies.standing(**bent), n_frames, axis=0)


# -- a weight of one ---------------------------------------------------------------------------


@pytest.mark.parametrize("n_dims", [3, 2])
@pytest.mark.parametrize("name", FORMATS)
def test_weight_of_one_gives_bodies_of_every_format_back(name, n_dims):
    skeleton = getattr(Skeleton, name)(n_dims=n_dims)
    X = [jittering(skeleton, n, seed) for seed, n in enumerate((40, 57))]
    times = np.sort(np.random.default_rng(2).uniform(0, 29, size=(2, 30)))
    times[:, [0, 1, -1]] = 0, 0, 29
    times[1, 10:14] = times[1, 10]
    for i in (0, 1):
        found = blend_trials(Match(times), X, {i: 1}, skeleton=skeleton)
        np.testing.assert_allclose(found, X[i], atol=1e-9)


def jittering(skeleton, n_frames, seed):
    rng = np.random.default_rng(seed)
    up = "xyz".index(skeleton.up[-1])
    (body,) = standing(1).reshape(1, -1, 3)
    places = dict(zip(PAPER.joints, body, strict=True))
    x = np.tile(places["neck"], (n_frames, len(skeleton.joints), 1))
    for landmark in skeleton.landmarks:
        x[:, list(skeleton.indices_of(landmark))] = places[landmark]
    x += rng.normal(scale=0.03, size=x.shape) + np.cumsum(
        rng.normal(scale=0.05, size=(n_frames, 1, 3)), axis=0
    )
    height = x[..., 1].copy() * (-1 if skeleton.up[0] == "-" else 1)
    x[..., 1], x[..., up] = x[..., up].copy(), height
    return x[..., : skeleton.n_dims].reshape(n_frames, -1)


@pytest.mark.parametrize(
    "landmarks",
    [
        {"left_hip": "a", "left_knee": ("b", "c"), "left_ankle": "d"},
        {"left_shoulder": "a", "left_elbow": ("b", "c"), "left_wrist": "d"},
        {"neck": "a", "head": "b"},
    ],
)
def test_weight_of_one_gives_incomplete_bodies_back(landmarks):
    skeleton = Skeleton(["a", "b", "c", "d", "e"], [-1, -1, -1, -1, 3], landmarks, up="z")
    X = [np.random.default_rng(s).normal(size=(20 + s, 15)) for s in (0, 1)]
    for i in (0, 1):
        found = blend_trials(even(*X), X, {i: 1}, skeleton=skeleton)
        np.testing.assert_allclose(found, X[i], atol=1e-9)
    assert np.isfinite(blend_trials(even(*X), X, [0.5, 0.5], skeleton=skeleton)).all()


# -- limbs ------------------------------------------------------------------------------------


@pytest.mark.parametrize("weights", [[0.5, 0.5], [0.9, 0.1], [1.3, -0.3], [[1, 0], [0, 1]]])
def test_lengths_of_limbs_are_weighted_means(weights):
    X = [walker(60), walker(80, size=1.3, seed=1)]
    found = blend_trials(even(*X), X, weights, skeleton=PAPER)
    own = [lengths_of(x, PAPER)[0] for x in X]
    if np.ndim(weights) == 1:
        weights = np.repeat([weights], len(found), axis=0)
    else:
        # The weights of a transition are even on the clock, and so is this blend's first frame.
        weights = np.linspace(*weights, len(found))[[0, -1]]
        found = found[[0, -1]]
    np.testing.assert_allclose(lengths_of(found, PAPER), weights @ own, atol=1e-9)


@pytest.mark.parametrize("parents", [PAPER.parents, [-1] * 15])
def test_tilted_hips_and_shoulders_keep_their_width(parents):
    """Means of their places would be 0.87 as far apart."""
    skeleton, X = Skeleton(PAPER.joints, parents), []
    girdles = {
        "pelvis": (0.2, ("hip", "knee", "ankle")),
        "neck": (0.4, ("shoulder", "elbow", "wrist")),
    }
    for degrees in (30, -30):
        turn = Rotation.from_euler("z", degrees, degrees=True).as_matrix()
        body = standing(9).reshape(9, -1, 3)
        for middle, (_, parts) in girdles.items():
            at = [PAPER.index_of(f"{s}_{part}") for s in ("left", "right") for part in parts]
            place = body[:, [PAPER.index_of(middle)]]
            body[:, at] = (body[:, at] - place) @ turn.T + place
        X.append(body.reshape(9, -1))
    found = blend_trials(even(*X), X, [0.5, 0.5], skeleton=skeleton).reshape(9, -1, 3)
    for middle, (width, (part, *_)) in girdles.items():
        left, right = (found[:, PAPER.index_of(f"{s}_{part}")] for s in ("left", "right"))
        np.testing.assert_allclose(np.linalg.norm(left - right, axis=1), width)
        np.testing.assert_allclose((left + right) / 2, found[:, PAPER.index_of(middle)])


def test_links_that_keep_their_length_do_in_the_blend():
    """A pelvis above the hips, of trunks that bend to both sides; the mean of places is nearer."""
    X = []
    for degrees in (40, -40):
        turn = Rotation.from_euler("x", degrees, degrees=True).as_matrix()
        body = standing(9).reshape(9, -1, 3)
        body[:, PAPER.index_of("pelvis")] += turn @ [0, 0.1, 0]
        X.append(body.reshape(9, -1))
    found = blend_trials(even(*X), X, [0.5, 0.5], skeleton=PAPER).reshape(9, -1, 3)
    hips = [found[:, PAPER.index_of(f"{side}_hip")] for side in ("left", "right")]
    apart = found[:, PAPER.index_of("pelvis")] - np.mean(hips, axis=0)
    np.testing.assert_allclose(np.linalg.norm(apart, axis=1), 0.1)


def test_recorded_limbs_do_not_shrink(bends):
    """Lengths lie between those of two subjects of optical motion capture."""
    one, other = (int(np.flatnonzero(bends.actor == a)[0]) for a in ("bd", "tr"))
    X = [np.asarray(bends.data[i], dtype=float) for i in (one, other)]
    pipe = make_pipeline(DirectionCosines(bends.skeleton), ASpace(), DenseSynchronizer(n_frames=60))
    found = blend_trials(pipe.fit(X), X, [0.5, 0.5])
    rigid = slice(0, 10)  # thighs, legs, arms, forearms, hips, shoulders
    mean = np.mean([np.median(lengths_of(x, bends.skeleton), axis=0) for x in X], axis=0)
    lengths = lengths_of(found, bends.skeleton)
    np.testing.assert_allclose(lengths[:, 0:8], np.tile(mean[:8], (len(found), 1)), rtol=1e-3)
    assert (lengths[:, rigid] > 0.9 * mean[rigid]).all()


# -- heading and path -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("headings", "share", "mean"),
    [((0, 90), 0.5, 45), ((0, 90), 0.25, 22.5), ((0, -140), 0.5, -70), ((170, -160), 0.5, -175)],
)
def test_headings_have_a_circular_mean(headings, share, mean):
    X = [turned(walker(60), degrees) for degrees in headings]
    found = blend_trials(even(*X), X, [1 - share, share], skeleton=PAPER)
    np.testing.assert_allclose(found, turned(walker(60), mean), atol=1e-9)


def test_turning_and_standing_bodies_give_half_the_turn():
    x = walker(61)
    degrees = np.linspace(0, 360, 61)
    around = np.stack([turned(f, d) for f, d in zip(standing(61), degrees, strict=True)])
    found = blend_trials(even(x, x), [around, standing(61)], [0.5, 0.5], skeleton=PAPER)
    half = np.stack([turned(f, d / 2) for f, d in zip(standing(61), degrees, strict=True)])
    # Feet of the second stand, and their chords are shorter than their arcs.
    np.testing.assert_allclose(found, half, atol=1e-4)


def cartwheel(lean, n=61):
    """All the way round about the pelvis, in a plane that leans by so many degrees."""
    degrees = np.stack([np.linspace(0, 360, n), np.full(n, lean)], axis=1)
    turns = Rotation.from_euler("zx", degrees, degrees=True).as_matrix()
    body = standing(n).reshape(n, -1, 3) - [0, 1, 0]
    return (body @ turns.transpose(0, 2, 1)).reshape(n, -1)


@pytest.mark.parametrize("leans", [(6, -6), (-2, 2), (8, 4)])
@pytest.mark.parametrize("n", [17, 61])
def test_blend_of_cartwheels_keeps_its_heading(leans, n):
    """Seen from above the hips rotate to the left in one, to the right in the other.

    They are near the vertical in a single frame of 17, or in several of 61.
    """
    X = [cartwheel(lean, n) for lean in leans]
    found = blend_trials(even(*X), X, [0.5, 0.5], skeleton=PAPER)
    middle = cartwheel(np.mean(leans), n)
    # From the pelvis, the first joint.
    apart = [x.reshape(n, -1, 3) - x.reshape(n, -1, 3)[:, :1] for x in (found, middle)]
    np.testing.assert_allclose(*apart, atol=0.05)
    for i in (0, 1):
        back = blend_trials(even(*X), X, {i: 1}, skeleton=PAPER)
        np.testing.assert_allclose(back, X[i], atol=1e-12)


def test_noise_does_not_rotate_a_lying_body():
    """The vertical hip line has no heading."""
    lying = np.repeat(cartwheel(0)[15:16], 61, axis=0)
    noise = np.random.default_rng(0).normal(scale=0.01, size=(2, *lying.shape))
    X = list(lying + noise)
    found = blend_trials(even(*X), X, [0.5, 0.5], skeleton=PAPER)
    assert np.abs(found - lying).max() < 0.08


def test_transition_between_walks_is_continuous():
    X = [walker(60), turned(walker(60, seed=1), 90)]
    X[1][:, ::3] += 20  # far away, on another floor
    X[1][:, 1::3] += 20
    found = blend_trials(even(*X), X, [[1, 0], [0, 1]], skeleton=PAPER)
    pelvis = found[:, [0, 2]]
    assert np.linalg.norm(np.diff(pelvis, axis=0), axis=1).max() < 0.1
    np.testing.assert_allclose(found[0], X[0][0], atol=0.02)
    # At the end it has the steps of the second walk in the heading of the first.
    steps = [np.diff(x[-3:, [0, 2]], axis=0)[-1] for x in (found, turned(X[1], -90))]
    np.testing.assert_allclose(*steps, atol=5e-3)


# -- timing -----------------------------------------------------------------------------------


def match_of_events(*events, n_frames=41):
    """A match of trials whose event lies at these shares of their time."""
    frames = np.arange(n_frames)
    middle = (n_frames - 1) / 2
    times = [np.interp(frames, [0, middle, 2 * middle], [0, 2 * e * middle, 2 * middle])
             for e in events]  # fmt: skip
    return Match(times)


def tent(n_frames, event):
    t = np.arange(n_frames) / (n_frames - 1)
    return np.interp(t, [0, event, 1], [0, 1, 0])[:, np.newaxis]


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 1.0])
def test_events_and_durations_are_blended(share):
    X = [tent(101, 0.3), tent(201, 0.6)]
    found = blend_trials(match_of_events(0.3, 0.6), X, [1 - share, share])
    assert len(found) == 101 + 100 * share
    # Events 30 and 120 frames from the beginning.
    assert found.argmax() == round((1 - share) * 30 + share * 120)
    assert found.max() == pytest.approx(1, abs=0.03)
    # Timing has weights of its own.
    found = blend_trials(match_of_events(0.3, 0.6), X, [1 - share, share], timing={1: 1})
    np.testing.assert_allclose(found, X[1], atol=0.03)


def test_extrapolated_time_never_runs_backwards():
    X = [tent(101, 0.3), tent(101, 0.4)]
    found = blend_trials(match_of_events(0.3, 0.4), X, [1.5, -0.5])
    assert found.argmax() == 25
    # Time does not run backwards, where it would: 0.3 - 4 * 0.1 of the time.
    found = blend_trials(match_of_events(0.3, 0.4), X, [5, -4])
    assert len(found) > 60
    assert 0 < found.argmax() <= 15 + 1


@pytest.mark.parametrize("weights", [[[1, 0], [0, 1]], [[1, 0], [1, 0], [0, 1], [0, 1]]])
def test_transition_takes_the_pace_of_each(weights):
    X = [np.linspace(0, 1, 51)[:, np.newaxis], np.linspace(0, 1, 201)[:, np.newaxis]]
    found = blend_trials(match_of_events(0.5, 0.5), X, weights)
    assert len(found) == 126
    speed = np.diff(found[:, 0])
    assert speed[0] == pytest.approx(1 / 50, rel=0.05)
    assert speed[-1] == pytest.approx(1 / 200, rel=0.05)


# -- kinds of input, and errors -----------------------------------------------------------------


def test_features_without_a_skeleton_are_averaged():
    X = [np.full((5, 2), 1.0), np.full((9, 2), 3.0)]
    found = blend_trials(LinearSynchronizer().fit(X), X, [0.25, 0.75])
    np.testing.assert_allclose(found, np.full((8, 2), 2.5))


def test_tables_keep_labels_and_names(bending):
    tables = [pd.DataFrame(x, columns=bending.skeleton.column_names) for x in bending.data[:3]]
    pipe = make_pipeline(DirectionCosines(bending.skeleton), DenseSynchronizer()).fit(tables)
    keys = ["ann", "bob", "cat"]
    df = pd.concat(tables, keys=keys, names=["subject", "time"])
    for X in (df, to_trials(df)):
        found = blend_trials(pipe, X, {"ann": 0.5, "cat": 0.5})
        assert list(found.columns) == bending.skeleton.column_names
        assert found.index.name == "frame"
        assert Skeleton.from_frame(found) == Skeleton.from_frame(tables[0])
    weights = pd.Series({"bob": 1.0})
    found = blend_trials(pipe, df, weights)
    np.testing.assert_allclose(found, tables[1], atol=1e-12)
    by_number = blend_trials(pipe, df, {1: 1})
    np.testing.assert_array_equal(by_number, found)


def test_a_blend_has_no_events_of_one_trial():
    takes = [pd.DataFrame({"knee": np.sin(np.arange(n) / 9)}) for n in (40, 50, 60)]
    for x in takes:
        x.attrs = {"frame_rate": 120.0, "units": "deg", "first_frame": 3, "events": [{"frame": 9}]}
    X = [x.iloc[::2] for x in takes]
    found = blend_trials(LinearSynchronizer().fit(X), X, [0.5, 0.5, 0])
    assert found.attrs == {"frame_rate": 60.0, "units": "deg"}


@pytest.mark.parametrize(
    ("times", "rate"),
    [
        (lambda n: 3 + np.arange(n) / 50, 50),
        (lambda n: pd.to_timedelta(np.arange(n) * 20, unit="ms"), 50),
        (lambda n: pd.date_range("2020", periods=n, freq="20ms"), 50),
        (lambda n: np.arange(7, 7 + 2 * n, 2), None),  # numbers of frames
    ],
)
def test_frames_of_tables_are_numbered(times, rate):
    X = [pd.DataFrame(np.ones((n, 2)), pd.Index(times(n), name="time")) for n in (41, 61)]
    found = blend_trials(even(*X), X, [0.5, 0.5])
    assert found.index.equals(pd.RangeIndex(51))
    assert found.index.name == "frame"
    assert found.attrs.get("frame_rate") == rate


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weights": [1, 1, 0]}, "sum 1, got 2"),
        ({"weights": [0.5, 0.5]}, "one for each of the 3 trials"),
        ({"weights": [[1, 0, 0], [np.nan, 1, 0]]}, "weights, row 1, feature 0 is NaN"),
        ({"weights": [1e9, 1 - 1e9, 0]}, "frames; the longest trial has 1"),
        ({"weights": {0: [0, 1], 1: [1, 0]}}, r"0 has numbers of shape \(2,\)"),
        ({"weights": [[1, 0, 0], [0, 0, 0]]}, "row 1, must have the sum 1"),
        ({"weights": np.zeros((2, 2, 3))}, "got shape"),
        ({"weights": {7: 1}}, "no trial 7"),
        ({"weights": "one"}, "not a numeric array"),
        ({"timing": [1, 1, 1]}, "timing must have the sum 1"),
        ({"skeleton": "kinect"}, "must be the Skeleton"),
        ({"skeleton": Skeleton.kinect()}, "joints need 60"),
        ({"X": np.zeros((5, 45))}, "Wrap one trial"),
        ({"X": [np.zeros((9, 3))] * 3}, "joints need 45"),
    ],
)
def test_refuses_invalid_arguments(bending, pipe, change, message):
    args = {"X": bending.data[:3], "weights": [1, 0, 0]} | change
    with pytest.raises(ValueError, match=message):
        blend_trials(pipe, **args)


def test_refuses_sequences_and_keyframes_that_do_not_suit_the_match(bending):
    X, keyframes = bending.data[:4], bending.keyframes[:4]
    with pytest.raises(ValueError, match="matched"):
        blend_trials(even(*X), X[:1], [1], skeleton=bending.skeleton)
    with pytest.raises(TypeError, match="takes no"):
        blend_trials(even(*X), X, [1, 0, 0, 0], keyframes=[])
    pipe = make_pipeline(DirectionCosines(bending.skeleton), LinearSynchronizer())
    pipe.fit(X, linearsynchronizer__keyframes=keyframes)
    with pytest.raises(ValueError, match=r"keyframes=\[...\] beside X"):
        blend_trials(pipe, X, [0, 1, 0, 0])


@pytest.mark.parametrize("heading", [0, 90])
def test_a_root_that_stands_still_is_no_limb(heading):
    """The others are blended as without it, and it stays between where it stood."""
    walks = [walker(50), turned(walker(50, 1.3, seed=1), heading)]
    tables = [with_still_root(x, PAPER, (k, 0.5, 2)) for k, x in enumerate(walks)]
    skeleton = Skeleton.from_frame(tables[0])
    blend = blend_trials(even(50, 50), tables, [0.25, 0.75], skeleton=skeleton)
    expected = blend_trials(even(50, 50), walks, [0.25, 0.75], skeleton=PAPER)
    np.testing.assert_allclose(blend[PAPER.column_names], expected, atol=1e-12)
    root = blend[["World_x", "World_y", "World_z"]]
    np.testing.assert_allclose(root, np.tile([0.75, 0.5, 2], (50, 1)), atol=1e-12)

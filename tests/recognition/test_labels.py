"""Labels of classes and of rejected trials: of any type, none is ever taken for another."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import ActionClassifier

# Two movements, five trials each.
T = np.linspace(0, 1, 20)
X = [np.column_stack([np.sin((3 + 3 * (i > 4)) * T), np.cos((4 + i / 9) * T)]) for i in range(10)]
LIMITS = {name: np.iinfo(name) for name in ("int8", "uint8", "int16", "int64", "uint64")}
# Pairs of classes as arrays or lists, and whether a class is text, a number or a date.
PAIRS = {
    **{name: (np.array([at.min, at.max], name), "number") for name, at in LIMITS.items()},
    "with -1": (np.array([-1, 4], np.int32), "number"),
    "with unknown": (np.array(["a", "unknown"]), "text"),
    "small uint64": (np.array([3, 4], np.uint64), "number"),
    "float16": (np.array([1, 2048], np.float16), "number"),
    "float32": (np.array([1, 2**24], np.float32), "number"),
    "float64": (np.array([-2.0, 2.0**53]), "number"),
    "bool": (np.array([False, True]), "number"),
    "list of integers": ([7, 200], "number"),
    "pandas Int64": (pd.array([5, 300], dtype="Int64"), "number"),
    "pandas categorical of integers": (pd.Categorical([1, 2]), "number"),
    "fixed width": (np.array(["a", "unk"]), "text"),
    "object": (np.array(["a", "longer"], dtype=object), "text"),
    "any width": (np.array(["a", "b"], dtype=np.dtypes.StringDType()), "text"),
    "list of text": (["3", "-1"], "text"),
    "pandas categorical": (pd.Categorical(["a", "b"]), "text"),
    "pandas string": (pd.array(["a", "b"], dtype="string"), "text"),
    "datetime64[D]": (np.array(["2020-01-01", "9999-12-31"], "M8[D]"), "date"),
    "datetime64[ns]": (np.array(["1969-12-31", "2020-01-01"], "M8[ns]"), "date"),
    "timedelta64[h]": (np.array([-1, 5], "m8[h]"), "date"),
}


def exact(label):
    """A label that Python compares, which rounds no number."""
    return label.item() if isinstance(label, np.generic) else label


@pytest.mark.parametrize("name", PAIRS)
def test_rejected_trials_never_have_a_class(name):
    pair, kind = PAIRS[name]
    given = list(pair)
    y = [label for label in given for _ in range(5)]
    y = y if isinstance(pair, list) else pair.take(np.repeat([0, 1], 5))
    classifier = ActionClassifier(n_frames=4).fit(X, y)
    plain = classifier.predict(X)
    assert all(exact(a) == exact(given[i // 5]) for i, a in enumerate(plain))
    scores = classifier.score_samples(X)
    border = float(np.median(scores))
    expected = {"number": -1, "text": "unknown", "date": np.datetime64("NaT")}[kind]
    dtypes = set()
    for threshold in (border, 1e9):
        classifier.set_params(reject_below=threshold)
        if expected in given:
            with pytest.raises(ValueError, match=f"{expected!r} is one of the classes"):
                classifier.predict(X)
            continue
        found = classifier.predict(X)
        for i, (a, score) in enumerate(zip(found, scores, strict=True)):
            if score < threshold:
                assert np.isnat(a) if kind == "date" else exact(a) == expected
            else:
                assert exact(a) == exact(given[i // 5])
        dtypes.add(found.dtype)
    # It does not depend on what is rejected.
    assert len(dtypes) <= 1


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        (["p"] * 5 + [3] * 5, r"y\[5\] is 3, y\[0\] is 'p': labels must be of one type"),
        ([3] * 5 + ["p"] * 5, r"y\[5\] is 'p', y\[0\] is 3: labels must be of one type"),
        (np.array(["p"] * 5 + [3] * 5, dtype=object), "labels must be of one type"),
        (np.array(["2020-01-01"] * 5 + ["NaT"] * 5, "M8[ns]"), r"y\[5\] is missing"),
    ],
)
def test_labels_of_several_types_or_missing_are_refused(labels, message):
    with pytest.raises(ValueError, match=message):
        ActionClassifier(n_frames=4).fit(X, labels)

"""What the readers of text files share: words and their lines, numbers and their limits, names."""

import numpy as np
import pytest
import sklearn_motionsync.io.text as text_module
from sklearn_motionsync.io.text import (
    MotionText,
    check_result_size,
    make_unique,
    read_rate,
    read_timed_rows,
    split_fields,
    split_subjects,
)

from motion_files import put


def opened(tmp_path, content):
    return MotionText(put(tmp_path, content, "a.txt"))


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", ["", "\xef\xbb\xbf"])
def test_words_come_with_the_number_of_their_line(tmp_path, end, mark):
    content = mark + end.join(["", "a b", "  ", "c{d}", "e f g", "", "h", "i"])
    text = opened(tmp_path, content)
    words = [(text.word("one"), text.line_number) for _ in range(7)]
    assert words == [(b"a", 2), (b"b", 2), *((x, 4) for x in (b"c", b"{", b"d", b"}")), (b"e", 5)]
    # What is left of the line, and the lines behind it.
    assert text.line() == [b"f", b"g"]
    assert (text.row(), text.line_number, text.is_whole) == (b"h", 7, True)
    assert text.n_left == 1
    assert (text.line(), text.line_number, text.is_whole) == ([b"i"], 8, False)
    assert (text.n_left, text.line(), text.row()) == (0, [], b"")
    with pytest.raises(ValueError, match=r"a\.txt, line 8: the file ends where one should follow"):
        text.word("one")
    text = opened(tmp_path, content)
    lines = [(b" ".join(words), text.line_number) for words in text.lines()]
    assert lines == [(b"a b", 2), (b"c{d}", 4), (b"e f g", 5), (b"h", 7), (b"i", 8)]


def test_numbers_are_finite_and_below_a_limit(tmp_path):
    """Each of them, and not their sum."""
    text, words = opened(tmp_path, ""), [b"0", b"-999999999999", b"1e-300", b"9e11", b"9e11"]
    assert list(text.numbers(words, 5, "it")) == list(map(float, words))
    for word in (b"1e12", b"-1e12", b"inf", b"nan", b"1_0", b"x", b"\xff"):
        for words in ([word], [b"1", word], [word, b"-2.5"]):
            with pytest.raises(ValueError, match="it needs finite numbers below 1e") as caught:
                text.numbers(words, len(words), "it")
            caught.match(f"got '{word.decode('latin-1')}")
    with pytest.raises(ValueError, match=r"it needs 2 numbers, got 1 \("):
        text.numbers([b"0"], 2, "it")
    text = opened(tmp_path, "9e11 9e11\n-9e11 9e11\n")
    assert text.table(2, "a frame").tolist() == [[9e11, 9e11], [-9e11, 9e11]]


def test_positive_numbers_have_an_inverse_below_the_limit(tmp_path):
    text = opened(tmp_path, "")
    for word, number in ((b"1", 1), (b"1.1e-12", 1.1e-12), (b"9e11", 9e11)):
        assert text.positive([word], "it") == number
    for word in (b"1e-12", b"0", b"-1"):
        with pytest.raises(ValueError, match="it must be above 0, got"):
            text.positive([word], "it")


def test_counts_are_whole_numbers_and_rates_above_0(tmp_path):
    text = opened(tmp_path, "")
    for word, count in ((b"1", 1), (b"3.0", 3), (b"9e11", 9 * 10**11), (b"0", 0), (b"-0", 0)):
        assert text.count(word, "it") == count
    for word in ("-1", "1.5", "1e13", "1_0", "nan", "inf", "x", ""):
        with pytest.raises(ValueError, match=f"it needs a whole number, 0 or more, got '{word}'"):
            text.count(word.encode(), "it")
    assert [read_rate(word) for word in (b"50", b"0.5", b"1e-9")] == [50, 0.5, 1e-9]
    for nothing in (b"0", b"-2", b"", b"fast", b"inf", b"nan"):
        assert read_rate(nothing) is None


# -- tables ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("seed", "blank"), [*enumerate(2 * [" ", "\t", "  ", " \t"])])
def test_tables_are_read_and_the_line_of_an_error_is_named(tmp_path, seed, blank):
    rng = np.random.default_rng(seed)
    n_rows, n = int(rng.integers(1, 30)), int(rng.integers(1, 5))
    values = rng.normal(size=(n_rows, n)) * 10.0 ** rng.integers(-9, 9, (n_rows, n))
    lines = [blank.join(map(repr, row)) for row in values.tolist()]
    if seed % 2:
        lines = [line + " " * int(rng.integers(3)) for line in lines]
    end = "\n" * (seed % 3 > 0)
    text = opened(tmp_path, "head\n" + "\n".join(lines) + end)
    assert text.line() == [b"head"]
    np.testing.assert_array_equal(text.table(n, "a frame"), values)
    assert (text.n_left, text.line_number) == (0, n_rows + 1)
    # One word too many, or a wrong one.
    for k in {0, n_rows - 1, n_rows // 2}:
        for wrong, message in ((lines[k] + " 1", f"got {n + 1}"), ("x " * n, "got 'x'")):
            other = "\n".join([*lines[:k], wrong, *lines[k + 1 :]])
            text = opened(tmp_path, "head\n" + other + end)
            text.line()
            with pytest.raises(ValueError, match=rf"line {k + 2}: a frame needs .*{message}"):
                text.table(n, "a frame")


@pytest.mark.parametrize("end", ["", "\n"])
def test_tables_of_several_portions_are_one(tmp_path, monkeypatch, end):
    """Of 4 kB each, and 5 numbers of 9 bytes a line."""
    monkeypatch.setattr(text_module, "PORTION", 2**12)
    values = np.random.default_rng(0).integers(10**7, 10**8, (200, 5)).astype(float)
    lines = [" ".join(f"{x:.0f}" for x in row) for row in values.tolist()]
    text = opened(tmp_path, "\n".join(lines) + end)
    np.testing.assert_array_equal(text.table(5, "a frame"), values)
    assert (text.n_left, text.line_number) == (0, len(lines))
    for k in (93, 199):
        other = "\n".join([*lines[:k], lines[k] + " 1", *lines[k + 1 :]]) + end
        with pytest.raises(ValueError, match=rf"line {k + 1}: a frame needs 5 numbers, got 6"):
            opened(tmp_path, other).table(5, "a frame")
    # A portion that is not plain has no influence on the others.
    lines[3] = "+" + lines[3].replace(" ", "  ") + "\f"
    text = opened(tmp_path, "\n".join(lines) + end)
    np.testing.assert_array_equal(text.table(5, "a frame"), values)
    assert text.line_number == len(lines)
    for nothing in ("", " \n\n", "\n"):
        assert opened(tmp_path, nothing).table(3, "a frame").shape == (0, 3)


def test_results_are_in_proportion_to_their_file():
    for n_bytes, file_size in ((2**26, 1), (2**26 + 1, 2**21 + 1), (2**30, 2**25)):
        check_result_size("a.x", file_size, n_bytes, "it")
    for n_bytes, file_size in ((2**26 + 1, 1), (2**26 + 1, 2**21), (2**30 + 1, 2**25)):
        size = f"{round(n_bytes / 2**20)} MB, from a file of {file_size / 2**20:.2f}"
        with pytest.raises(ValueError, match=rf"^a\.x: it would take {size}"):
            check_result_size("a.x", file_size, n_bytes, "it")


# -- rows with a time -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("row", "n", "fields"),
    [
        (b"a b  c", None, [b"a", b"b", b"c"]),
        (b"a\tb c\t d ", None, [b"a", b"b c", b"d"]),
        (b"a\t\tb\t\t", None, [b"a", b"", b"b", b"", b""]),
        (b"a\t\tb\t\t", 4, [b"a", b"", b"b", b""]),
        (b"a\t\tb\t\t", 2, [b"a", b"", b"b"]),
        (b"a\t\t", 0, [b"a"]),
        (b"\t\t", 0, []),
        (b"", None, []),
    ],
)
def test_fields_between_tabs_may_be_blank(row, n, fields):
    assert split_fields(row, n) == fields


@pytest.mark.parametrize(
    ("times", "decimals"),
    [
        (["0", "1"], 0),
        (["0.", "1.5"], 1),
        (["0.25 ", "1.5"], 2),
        (["0", "1.000", "2"], 3),
        (["0.1", "1e0"], 17),
        (["0.1", "1E0"], 17),
        (["-1.5", "-1.25", "-1.25"], 2),
    ],
)
def test_times_have_so_many_decimals(tmp_path, times, decimals):
    rows = [[b"x", b"nan", b"-N/A", b"", time.encode(), b"7"][1:] for time in times]
    numbers, found = read_timed_rows(opened(tmp_path, ""), rows, 3)
    assert found == decimals
    for row, time in zip(numbers, times, strict=True):
        np.testing.assert_array_equal(row, [np.nan, np.nan, np.nan, float(time), 7])


@pytest.mark.parametrize(
    "times", [["1e12"], ["-1e12"], ["inf"], ["nan"], [""], ["1", "0.999"], ["-1", "-1.5"]]
)
def test_times_that_are_none_or_decrease_are_refused(tmp_path, times):
    with pytest.raises(ValueError, match="the time of a row must be a number, and"):
        read_timed_rows(opened(tmp_path, ""), [[time.encode()] for time in times], 0)
    good = [[b"-9e11"], [b"9e11"], [b"9e11"]]
    numbers, _ = read_timed_rows(opened(tmp_path, ""), good, 0)
    assert np.ravel(numbers).tolist() == [-9e11, 9e11, 9e11]
    with pytest.raises(ValueError, match="the file ends where frames should follow"):
        read_timed_rows(opened(tmp_path, ""), [], 0)


# -- names ------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_names_that_come_again_get_the_next_free_number(seed):
    rng = np.random.default_rng(seed)
    choices = ["a", "b", "a_2", "a_3", "a_2_2", "b_2"]
    names = rng.choice(choices, rng.integers(1, 12)).tolist()
    expected, last = [], {}
    for k, name in enumerate(names):
        if name not in names[:k]:
            expected.append(name)
            continue
        taken = {*names, *expected}
        number = next(n for n in range(last.get(name, 1) + 1, 99) if f"{name}_{n}" not in taken)
        last[name] = number
        expected.append(f"{name}_{number}")
    assert make_unique(names) == expected
    assert len(set(expected)) == len(names)


@pytest.mark.parametrize(
    ("names", "subjects"),
    [
        (["Ann:LASI", "Ann:RASI", "*12", "C:7"], ["Ann", "Ann", "", ""]),
        (["A:LASI", "A:RASI", "B:LASI", "B:", "B:RASI"], ["A", "A", "B", "", "B"]),
        (["lab:Ann:LASI", "lab:Ann:RASI", ":a", ":b"], ["lab:Ann", "lab:Ann", "", ""]),
        (["Ann:LASI"], [""]),
        (["Ann_LASI", "Ann_RASI"], ["Ann", "Ann"]),
        (["s_01_LKNE", "s_01_LANK", "s_01_LTHI"], ["s_01"] * 3),
        (["Ann_LASI", "Ann_RASI", "SACR"], ["", "", ""]),
        (["L_Knee", "L_Ankle"], ["", ""]),
        (["Ann_Left_Knee", "Ann_Left_Ankle"], ["Ann", "Ann"]),
        (["box_front", "box_back", "box_top"], ["", "", ""]),
        (["Ann_LASI"], [""]),
        ([], []),
    ],
)
def test_names_are_split_into_subject_and_marker(names, subjects):
    markers, found = split_subjects(names)
    assert found == subjects
    assert markers == [n[len(s) + bool(s) :] for n, s in zip(names, subjects, strict=True)]
    assert split_subjects(["Ann:LKneeAngles"], ["Ann:LKneeAngles", "Ann:LASI"])[1] == ["Ann"]

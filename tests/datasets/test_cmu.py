"""fetch_cmu against a server of this machine: the cache, and failures of the download."""

import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import Skeleton
from sklearn_motionsync.datasets import fetch_cmu
from sklearn_motionsync.io import read_motion

BONE = "begin\nname {}\ndirection 0 {} 0\nlength 1\naxis 0 0 0 XYZ\n{}end\n"
AMC = b"1\nroot 0 1 0 0 0 0\nhead 0\n2\nroot 0 2 0 0 0 0\nhead 5\n"


def skeleton_file():
    """Acclaim's joints; only the head moves."""
    known = Skeleton.acclaim()
    names = known.joints
    bones = [BONE.format(name, 1, "dof rx\n" * (name == "head")) for name in names[1:]]
    pairs = [f"{names[p]} {names[j]}\n" for p, j in known.bones]
    root = ":root\norder TX TY TZ RX RY RZ\naxis XYZ\nposition 0 0 0\norientation 0 0 0\n"
    text = f":units\nlength 0.45\n{root}:bonedata\n{''.join(bones)}:hierarchy\n{''.join(pairs)}"
    return text.encode()


class Site:
    """The files of the server, its failures, and the paths that were requested."""

    def __init__(self):
        self.files = {
            "/subjects/02/02.asf": skeleton_file(),
            "/subjects/02/02_01.amc": AMC,
            "/subjects/02/02_02.amc": AMC + b"3\nroot 0 3 0 0 0 0\nhead 5\n",
        }
        self.requests = []
        self.fail = []  # status codes of the answers to come
        self.missing_bytes = 0

    def answer(self, handler):
        self.requests.append(handler.path)
        content = self.files.get(handler.path)
        code = self.fail.pop(0) if self.fail else 200 if content is not None else 404
        handler.send_response(code)
        content = content if code == 200 else b"sorry"
        handler.send_header("Content-Length", str(len(content)))
        handler.end_headers()
        handler.wfile.write(content[: len(content) - self.missing_bytes])


@pytest.fixture
def site(monkeypatch):
    # No proxy for 127.0.0.1.
    monkeypatch.setenv("no_proxy", "*")
    site = Site()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            site.answer(self)

        def log_message(self, *args):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    site.url = f"http://127.0.0.1:{server.server_port}/subjects"
    yield site
    server.shutdown()
    thread.join()
    server.server_close()


def fetch(site, folder, trials=(1, 2), **params):
    params = {"url": site.url, "n_retries": 0, "delay": 0.0} | params
    return fetch_cmu(2, trials, data_home=folder, **params)


def kept(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


def test_bunch_holds_the_trials(site, tmp_path):
    bunch = fetch(site, tmp_path)
    assert [len(df) for df in bunch.data] == [2, 3]
    assert bunch.subject == "02"
    assert bunch.take.tolist() == ["01", "02"]
    assert bunch.skeleton == Skeleton.acclaim()
    assert bunch.joints == list(Skeleton.acclaim().joints)
    assert bunch.frame_rate.tolist() == [120, 120]
    assert bunch.units == "m"
    assert bunch.data[0].attrs["frame_rate"] == 120
    assert bunch.filenames[1] == str(tmp_path / "cmu_mocap" / "02" / "02_02.amc")
    pd.testing.assert_frame_equal(bunch.data[1], read_motion(bunch.filenames[1], frame_rate=120))
    assert "may not resell this data directly" in " ".join(bunch.DESCR.split())


def test_kept_files_need_no_network(site, tmp_path):
    first = fetch(site, tmp_path)
    assert site.requests == list(site.files)
    again = fetch(site, tmp_path)
    fetch(site, tmp_path, "01", url="http://127.0.0.1:1", download_if_missing=False)
    assert len(site.requests) == 3
    pd.testing.assert_frame_equal(first.data[1], again.data[1])
    fetch(site, tmp_path, [1, 1, "2"])
    assert len(site.requests) == 3
    assert kept(tmp_path) == [f"cmu_mocap/02/{n}" for n in ("02.asf", "02_01.amc", "02_02.amc")]


def test_missing_trial_is_an_error(site, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no 02_77\.amc at .*HTTP 404.* does not exist"):
        fetch(site, tmp_path, [1, 77])
    assert kept(tmp_path) == ["cmu_mocap/02/02.asf", "cmu_mocap/02/02_01.amc"]
    assert len(site.requests) == 3
    with pytest.raises(FileNotFoundError, match=r"no 900\.asf at "):
        fetch_cmu("900", 1, data_home=tmp_path, url=site.url, n_retries=0)


@pytest.mark.filterwarnings("ignore:Retry downloading:UserWarning")
def test_failed_requests_are_repeated(site, tmp_path):
    site.fail = [503, 500]
    assert len(fetch(site, tmp_path, n_retries=2).data) == 2
    assert len(site.requests) == 5
    site.fail = [503, 503]
    with pytest.raises(OSError, match=r"could not be got from .*503.*by hand"):
        fetch(site, tmp_path / "other", n_retries=1)


def test_incomplete_download_is_not_kept(site, tmp_path):
    site.missing_bytes = 20
    with pytest.raises(OSError, match=r"02\.asf is not in .*got only \d+ out of \d+ bytes"):
        fetch(site, tmp_path)
    assert kept(tmp_path) == []
    site.missing_bytes = 0
    assert len(fetch(site, tmp_path).data) == 2


def test_unreadable_files_are_named(site, tmp_path):
    site.files["/subjects/02/02_01.amc"] = b"<html>Please log in</html>"
    with pytest.raises(ValueError, match=r"02_01\.amc, line 1: .* Delete that file to get it ag"):
        fetch(site, tmp_path)
    site.files["/subjects/02/02_01.amc"] = AMC
    (tmp_path / "cmu_mocap" / "02" / "02_01.amc").unlink()
    message = (
        rf"02_01\.amc is not in {tmp_path}/cmu_mocap/02 .*{site.url}/02/02_01\.amc: download_if"
    )
    with pytest.raises(OSError, match=message + ".*by hand into that folder, or give another url="):
        fetch(site, tmp_path, download_if_missing=False)
    assert len(fetch(site, tmp_path).data[0]) == 2


@pytest.mark.parametrize("number", ["../01", "", 0, 1.5, None, "1e3", "\u0663", 12345])
def test_wrong_numbers_are_refused(tmp_path, number):
    with pytest.raises(ValueError, match="subject must be numbers from 1"):
        fetch_cmu(number, 1, data_home=tmp_path)
    with pytest.raises(ValueError, match="trials must be numbers from 1"):
        fetch_cmu(1, [number], data_home=tmp_path)
    with pytest.raises(ValueError, match="trials must be one number or several, got none"):
        fetch_cmu(1, [], data_home=tmp_path)
    assert kept(tmp_path) == []


@pytest.mark.parametrize(
    "params",
    [
        {"n_retries": -1},
        {"delay": np.nan},
        {"url": None},
        {"download_if_missing": "no"},
    ],
    ids=str,
)
def test_parameters_out_of_range_are_refused(site, tmp_path, params):
    with pytest.raises(ValueError, match=f"'{next(iter(params))}' parameter of fetch_cmu"):
        fetch(site, tmp_path, **params)
    assert site.requests == []
    assert kept(tmp_path) == []


def test_real_walks_have_acclaims_skeleton(site, tmp_path, real_data):
    folder = real_data / "original_files" / "asf_amc"
    for path in folder.glob("02*"):
        site.files[f"/subjects/02/{path.name}"] = path.read_bytes()
    bunch = fetch(site, tmp_path)
    assert [df.shape for df in bunch.data] == [(343, 93), (298, 93)]
    assert bunch.skeleton == Skeleton.acclaim()

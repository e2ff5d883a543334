"""Claims about fetching, against a server on loopback."""

from __future__ import annotations

import hashlib
import http.server
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from shape_helpers import fibonacci_ellipsoid

from landing_cli.body.mesh import Mesh
from landing_cli.errors import InputRefused, OutputRefused, UsageError
from landing_cli.sources import shape_archive
from landing_cli.sources.download import fetch_file
from landing_cli.sources.shape_files import obj_text, read_shape

BODY: Mesh = fibonacci_ellipsoid((300.0, 200.0, 150.0), 40)
GOOD = obj_text(BODY, [], "km").replace("\n", "\r\n").encode()


class Server:
    def __init__(self) -> None:
        self.files: dict[str, bytes] = {"/data/good.tab": GOOD, "/data/big.tab": b"#" * 3_000_000}
        self.asked: list[str] = []
        outer = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                outer.asked.append(self.path)
                if self.path == "/moved.tab":
                    self.send_response(302)
                    self.send_header("Location", "file:///etc/hostname")
                    self.end_headers()
                    return
                data = outer.files.get(self.path)
                if data is None:
                    self.send_error(404)
                    return
                self.send_response(200)
                extra = 1000 if self.path.endswith("cut.tab") else 0
                self.send_header("Content-Length", str(len(data) + extra))
                self.end_headers()
                self.wfile.write(data)

            def log_message(self, *_: object) -> None:
                pass

        self._http = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._http.server_port}"
        self._thread = threading.Thread(target=self._http.serve_forever, args=(0.01,), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self._http.shutdown()
        self._http.server_close()
        self._thread.join()


@pytest.fixture
def server(monkeypatch) -> Iterator[Server]:
    for name in ("http_proxy", "https_proxy", "all_proxy", "HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY"):
        monkeypatch.delenv(name, raising=False)
    running = Server()
    yield running
    running.stop()


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_download_records_its_hash_and_is_not_repeated(server, tmp_path):
    first = fetch_file(f"{server.url}/data/good.tab", tmp_path / "new")
    assert first.fresh
    assert first.path.read_bytes() == GOOD
    assert first.sha256 == hashlib.sha256(GOOD).hexdigest()
    assert (tmp_path / "new" / "good.tab.sha256").read_text() == f"{first.sha256}  good.tab\n"
    again = fetch_file(f"{server.url}/data/good.tab", tmp_path / "new")
    assert not again.fresh
    assert server.asked == ["/data/good.tab"]
    assert names(tmp_path / "new") == ["good.tab", "good.tab.sha256"]


def test_a_changed_file_is_refused_on_disk_and_on_the_server(server, tmp_path):
    fetched = fetch_file(f"{server.url}/data/good.tab", tmp_path)
    fetched.path.write_bytes(GOOD + b"# tampered")
    with pytest.raises(InputRefused, match=r"good\.tab: its sha256 .* is not .*--force downloads it again"):
        fetch_file(f"{server.url}/data/good.tab", tmp_path)
    fetched.path.unlink()
    server.files["/data/good.tab"] = b"other"
    with pytest.raises(InputRefused, match="what arrived has sha256"):
        fetch_file(f"{server.url}/data/good.tab", tmp_path)
    assert names(tmp_path) == ["good.tab.sha256"]
    assert fetch_file(f"{server.url}/data/good.tab", tmp_path, force=True).path.read_bytes() == b"other"


def test_the_hash_that_the_user_gives_is_held_to(server, tmp_path):
    right = hashlib.sha256(GOOD).hexdigest()
    with pytest.raises(InputRefused, match=f"not {'0' * 64}"):
        fetch_file(f"{server.url}/data/good.tab", tmp_path, sha256="0" * 64)
    assert names(tmp_path) == []
    assert fetch_file(f"{server.url}/data/good.tab", tmp_path, sha256=right.upper()).sha256 == right
    with pytest.raises(UsageError, match="'abc' is no SHA-256"):
        fetch_file(f"{server.url}/data/good.tab", tmp_path, sha256="abc")


def test_a_published_hash_is_asked_of_what_arrives(server, tmp_path):
    right = hashlib.md5(GOOD).hexdigest()
    assert fetch_file(f"{server.url}/data/good.tab", tmp_path / "a", published_hash=f"md5:{right}").fresh
    with pytest.raises(InputRefused, match="does not have the published hash md5:0000"):
        fetch_file(f"{server.url}/data/good.tab", tmp_path / "b", published_hash="md5:" + "0" * 32)
    assert names(tmp_path) == ["a"]


def test_a_file_of_unknown_origin_is_not_taken_for_the_download(server, tmp_path):
    (tmp_path / "good.tab").write_text("mine")
    with pytest.raises(InputRefused, match="is there already, and nothing says"):
        fetch_file(f"{server.url}/data/good.tab", tmp_path)
    assert (tmp_path / "good.tab").read_text() == "mine"


def test_more_than_the_cap_is_refused_and_leaves_nothing(server, tmp_path):
    with pytest.raises(InputRefused, match="sends more than 1 MiB"):
        fetch_file(f"{server.url}/data/big.tab", tmp_path, cap_bytes=2**20)
    assert names(tmp_path) == []


def test_a_download_that_breaks_off_is_refused_and_leaves_nothing(server, tmp_path):
    server.files["/cut.tab"] = GOOD
    with pytest.raises(InputRefused, match=r"cannot be downloaded: .*IncompleteRead"):
        fetch_file(f"{server.url}/cut.tab", tmp_path)
    assert names(tmp_path) == []


def test_a_missing_file_and_a_missing_server_are_told_in_words(server, tmp_path):
    with pytest.raises(InputRefused, match="cannot be downloaded: the server answers 404 Not Found"):
        fetch_file(f"{server.url}/none.tab", tmp_path)
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        port = closed.getsockname()[1]
    with pytest.raises(InputRefused, match=r"cannot be downloaded: .*refused; is this machine online"):
        fetch_file(f"http://127.0.0.1:{port}/a.tab", tmp_path)


@pytest.mark.parametrize(
    "url",
    ["file:///etc/passwd", "ftp://host/a.tab", "a.tab", "http:///a.tab", "http://[bad/a.tab", "//host/a.tab"],
)
def test_only_http_and_https_are_asked(url, tmp_path):
    with pytest.raises(UsageError, match="is no"):
        fetch_file(url, tmp_path)


@pytest.mark.parametrize("tail", ["", "data/", "..", "%2e%2e", "a%2fb%2f..", ".hidden", "a b", "x" * 200])
def test_a_url_cannot_choose_where_the_file_goes(server, tmp_path, tail):
    with pytest.raises(UsageError, match="names no file that could be written"):
        fetch_file(f"{server.url}/{tail}", tmp_path)


def test_a_redirect_out_of_http_is_not_followed(server, tmp_path):
    with pytest.raises(InputRefused, match="cannot be downloaded"):
        fetch_file(f"{server.url}/moved.tab", tmp_path)
    assert names(tmp_path) == []


def test_a_folder_that_cannot_be_made_is_refused(server, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputRefused, match="cannot be written"):
        fetch_file(f"{server.url}/data/good.tab", tmp_path / "file")


def test_the_fetched_table_passes_the_strict_reader(server, tmp_path):
    path = fetch_file(f"{server.url}/data/good.tab", tmp_path).path
    assert len(read_shape(path, "km").mesh.faces) == len(BODY.faces)


def test_the_official_files_are_in_the_archive_of_the_planetary_data_system():
    for shape in shape_archive.OFFICIAL_SHAPES.values():
        assert shape.url.startswith("https://sbnarchive.psi.edu/pds3/")
        assert shape.url.endswith(".tab")

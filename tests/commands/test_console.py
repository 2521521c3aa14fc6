import re
import socket

import pytest
import uvicorn


@pytest.fixture
def port():
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return probe.getsockname()[1]


@pytest.fixture
def opened(monkeypatch):
    """What would be served; nothing is."""
    served = []

    def run(server, sockets):
        served.append((server.config, sockets[0].getsockname()))

    monkeypatch.setattr(uvicorn.Server, "run", run)
    return served


def test_it_listens_at_this_computer_alone_and_shows_the_link(folder, run, port, opened):
    status, out, err = run("console", folder, "--port", port)
    assert (status, err) == (0, "")
    assert re.search(rf"http://127\.0\.0\.1:{port}/#[\w-]{{32,}}\nconsole closed\n$", out)
    assert opened[0][1] == ("127.0.0.1", port)
    assert "█" not in out


@pytest.mark.slow
def test_for_another_device_the_link_is_a_qr_code_too(folder, run, port, opened, monkeypatch):
    monkeypatch.setattr("prior_reinforce.commands.console._own_address", lambda: "192.168.1.5")
    status, out, _ = run("console", folder, "--host", "0.0.0.0", "--port", port)
    assert status == 0
    assert f"http://192.168.1.5:{port}/#" in out
    assert "▀" in out or "█" in out
    assert "whoever has this link can move the arm" in out


def has_ipv6():
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        return False
    return True


@pytest.mark.skipif(not has_ipv6(), reason="this computer has no IPv6")
@pytest.mark.parametrize(("host", "own"), [("::1", "[::1]"), ("::", "127.0.0.1")])
def test_it_listens_at_an_address_of_ipv6(folder, run, port, opened, monkeypatch, host, own):
    monkeypatch.setattr("prior_reinforce.commands.console._own_address", lambda: "127.0.0.1")
    status, out, err = run("console", folder, "--host", host, "--port", port)
    assert (status, err) == (0, "")
    assert f"http://{own}:{port}/#" in out
    assert opened[0][1][:2] == (host, port)


def test_the_same_link_again(folder, run, port, opened):
    assert run("console", folder, "--port", port) == run("console", folder, "--port", port)


@pytest.mark.slow
def test_with_a_certificate_it_answers_by_https(
    folder, run, port, opened, certificate, monkeypatch
):
    monkeypatch.setattr("prior_reinforce.commands.console._own_address", lambda: "192.168.1.5")
    pair = ["--certificate", certificate[0], "--key", certificate[1]]
    status, out, _ = run("console", folder, "--host", "0.0.0.0", "--port", port, *pair)
    assert status == 0
    assert f"https://192.168.1.5:{port}/#" in out
    assert "only over https" not in out
    opened[0][0].load()
    assert opened[0][0].is_ssl


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--key", "key.pem"], "--key is of a --certificate"),
        (["--certificate", "nowhere.pem"], "No such file"),
        (["--certificate", "planar/workspace.toml"], "give a certificate and its key as PEM"),
        (["--host", "203.0.113.7"], "cannot listen"),
        (["--port", "99999999"], "cannot listen"),
        (["--run", "mycontroller"], "{plan}"),
        (["--run", "mycontroller {plan}", "--time-limit", "-1"], "time"),
    ],
)
def test_what_cannot_be_is_one_line(folder, run, opened, given, said):
    status, _, err = run("console", folder, *given)
    assert (status, err.count("\n")) == (2, 1)
    assert said in err
    assert not opened


def test_a_folder_that_is_no_workspace_is_one_line(tmp_path, run, port, opened):
    status, _, err = run("console", tmp_path, "--port", port)
    assert status == 2
    assert "not a workspace" in err
    assert not (tmp_path / ".console-token").exists()


def test_a_port_that_is_taken_is_one_line(folder, run, port, opened):
    with socket.create_server(("127.0.0.1", port)):
        status, _, err = run("console", folder, "--port", port)
    assert status == 2
    assert "another --host or --port" in err
